//! Arrays of NumPy, as arguments and as results.
//!
//! Arguments are read while the calling thread holds the interpreter's lock, and copied to the library's own types: nothing refers to
//! an array once the lock is released, so that other threads of Python may write to it. NumPy writes some arrays without the lock; a query
//! at the same moment sees old and new numbers mixed. Each number is read once and checked after it was copied, so that no mixture is out of
//! range.

use numpy::ndarray::{ArrayView1, ArrayView2};
use numpy::{
    Element, Ix1, Ix2, PyArray, PyArray1, PyArrayDescrMethods, PyArrayMethods, PyReadonlyArray,
    PyUntypedArray, PyUntypedArrayMethods,
};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::errors::{no_memory, wrong_type, wrong_value};
use crate::threads::each_on_threads;

/// Rows in one array. Arrays that repeat one row in memory may have far more rows than memory has room for.
const MOST_ROWS: usize = u32::MAX as usize;

/// An array whose numbers are read without a copy.
pub(crate) struct Readable<'py, T: Element, D: numpy::ndarray::Dimension> {
    array: PyReadonlyArray<'py, T, D>,
}

impl<'py, T: Element, D: numpy::ndarray::Dimension> Readable<'py, T, D> {
    fn new(argument: &str, array: &Bound<'py, PyUntypedArray>) -> PyResult<Self> {
        let array = array
            .cast::<PyArray<T, D>>()
            .map_err(|error| wrong_type(argument, error))?;
        let array = array
            .try_readonly()
            .map_err(|error| wrong_value(argument, error))?;
        Ok(Self { array })
    }
}

/// Three floats in each row, in either precision.
pub(crate) enum Rows<'py> {
    /// f32.
    Single(Readable<'py, f32, Ix2>),
    /// f64. Integers, too.
    Double(Readable<'py, f64, Ix2>),
}

/// [`Rows`], ready to be read.
#[derive(Clone, Copy)]
pub(crate) enum RowsView<'a> {
    Single(ArrayView2<'a, f32>),
    Double(ArrayView2<'a, f64>),
}

impl<'py> Rows<'py> {
    /// An argument of shape (N, 3), or (3,) for one row.
    pub(crate) fn new(argument: &str, value: &Bound<'py, PyAny>) -> PyResult<Self> {
        let array = as_array(argument, value)?;
        let shape = array.shape();
        let array = match *shape {
            [3] => {
                let array = array.call_method1("reshape", ((1, 3),))?;
                array.cast_into::<PyUntypedArray>()?
            }
            [_, 3] => array,
            // An empty list has no second length.
            [0] => empty_rows(value.py())?,
            _ => {
                let shape = shape_of(shape);
                return Err(wrong_value(
                    argument,
                    format_args!("expected an array of shape (N, 3), got {shape}"),
                ));
            }
        };
        check_rows(argument, array.shape()[0])?;
        if kind(&array) == 'f' && array.dtype().itemsize() == 4 {
            let array = in_place_or_copy(argument, array, "float32")?;
            return Ok(Self::Single(Readable::new(argument, &array)?));
        }
        if !matches!(kind(&array), 'f' | 'i' | 'u') {
            return Err(wrong_type(
                argument,
                format_args!("expected floats, got an array of dtype {}", array.dtype()),
            ));
        }
        let array = in_place_or_copy(argument, array, "float64")?;
        Ok(Self::Double(Readable::new(argument, &array)?))
    }

    pub(crate) fn view(&self) -> RowsView<'_> {
        match self {
            Self::Single(rows) => RowsView::Single(rows.array.as_array()),
            Self::Double(rows) => RowsView::Double(rows.array.as_array()),
        }
    }

    pub(crate) fn len(&self) -> usize {
        match self {
            Self::Single(rows) => rows.array.len() / 3,
            Self::Double(rows) => rows.array.len() / 3,
        }
    }
}

impl RowsView<'_> {
    /// Calls `each` with a number and a row for rows from `start` on, in f64.
    #[inline]
    pub(crate) fn for_each(&self, start: usize, count: usize, each: impl FnMut(usize, [f64; 3])) {
        match self {
            Self::Single(rows) => for_each_row(rows, start, count, each),
            Self::Double(rows) => for_each_row(rows, start, count, each),
        }
    }
}

/// One loop for rows without gaps, another for all others.
#[inline]
fn for_each_row<T: Copy + Into<f64>>(
    rows: &ArrayView2<'_, T>,
    start: usize,
    count: usize,
    mut each: impl FnMut(usize, [f64; 3]),
) {
    if let Some(all) = rows.as_slice() {
        let (rows, _) = all[3 * start..3 * (start + count)].as_chunks::<3>();
        for (i, row) in rows.iter().enumerate() {
            each(i, row.map(Into::into));
        }
        return;
    }
    for i in 0..count {
        let row = [0, 1, 2].map(|k| rows[[start + i, k]].into());
        each(i, row);
    }
}

/// One number for all rows, or one for each.
pub(crate) enum Numbers<'py> {
    One(f64),
    Each(Readable<'py, f64, Ix1>),
}

/// [`Numbers`], ready to be read.
#[derive(Clone, Copy)]
pub(crate) enum NumbersView<'a> {
    One(f64),
    Each(ArrayView1<'a, f64>),
}

impl<'py> Numbers<'py> {
    /// An argument that is one number, or of shape (N,).
    pub(crate) fn new(argument: &str, value: &Bound<'py, PyAny>, rows: usize) -> PyResult<Self> {
        if let Ok(number) = value.extract::<f64>()
            && !value.is_instance_of::<PyUntypedArray>()
        {
            return Ok(Self::One(number));
        }
        let array = as_array(argument, value)?;
        if !matches!(kind(&array), 'f' | 'i' | 'u') {
            return Err(wrong_type(
                argument,
                format_args!("expected floats, got an array of dtype {}", array.dtype()),
            ));
        }
        let array = in_place_or_copy(argument, array, "float64")?;
        if array.shape().is_empty() {
            return Ok(Self::One(array.call_method0("item")?.extract()?));
        }
        check_shape(argument, array.shape(), rows)?;
        Ok(Self::Each(Readable::new(argument, &array)?))
    }

    pub(crate) fn view(&self) -> NumbersView<'_> {
        match self {
            Self::One(number) => NumbersView::One(*number),
            Self::Each(numbers) => NumbersView::Each(numbers.array.as_array()),
        }
    }
}

impl NumbersView<'_> {
    #[inline]
    pub(crate) fn at(&self, row: usize) -> f64 {
        match self {
            Self::One(number) => *number,
            Self::Each(numbers) => numbers[row],
        }
    }
}

/// Bits for all rows, or for each.
pub(crate) enum Bits {
    One(u32),
    Each(Vec<u32>),
}

impl Bits {
    /// An argument that is one integer, or integers of shape (N,), from 0 to 2³² − 1.
    pub(crate) fn new(argument: &str, value: &Bound<'_, PyAny>, rows: usize) -> PyResult<Self> {
        let array = as_array(argument, value)?;
        let wrong = |row: usize, number: i64| {
            wrong_value(
                argument,
                format_args!("row {row} is {number}, expected 0 to 2^32 - 1"),
            )
        };
        let numbers = integers(argument, array)?;
        if numbers.shape().is_empty() {
            let number: i64 = numbers.call_method0("item")?.extract()?;
            return u32::try_from(number)
                .map(Self::One)
                .map_err(|_| wrong(0, number));
        }
        check_shape(argument, numbers.shape(), rows)?;
        let numbers = Readable::<i64, Ix1>::new(argument, &numbers)?;
        let mut all = reserved(rows, argument)?;
        for (row, &number) in numbers.array.as_array().iter().enumerate() {
            all.push(u32::try_from(number).map_err(|_| wrong(row, number))?);
        }
        Ok(Self::Each(all))
    }

    #[inline]
    pub(crate) fn at(&self, row: usize) -> u32 {
        match self {
            Self::One(bits) => *bits,
            Self::Each(all) => all[row],
        }
    }
}

/// The indices of triangles: integers of shape (M, 3), of any width.
pub(crate) fn faces(argument: &str, value: &Bound<'_, PyAny>) -> PyResult<Vec<[u32; 3]>> {
    let array = as_array(argument, value)?;
    let array = match *array.shape() {
        [_, 3] => array,
        [0] => empty_rows(value.py())?
            .call_method1("astype", ("int64",))?
            .cast_into()?,
        ref shape => {
            let shape = shape_of(shape);
            return Err(wrong_value(
                argument,
                format_args!("expected an array of shape (M, 3), got {shape}"),
            ));
        }
    };
    let rows = array.shape()[0];
    if rows > kd::tree::MAX_TRIANGLES {
        return Err(crate::errors::of_mesh(&kd::MeshError::TooLarge {
            triangles: rows,
        }));
    }
    let mut faces = reserved(rows, argument)?;
    let wrong = |row: usize, index: i64| {
        let problem = if index < 0 {
            format!("index {index}, which is negative")
        } else {
            "an index above 2^32 - 1".to_owned()
        };
        wrong_value(argument, format_args!("row {row} has {problem}"))
    };
    // The widths that most arrays have are read in place.
    if kind(&array) == 'i' && array.dtype().itemsize() == 4 {
        let array = in_place_or_copy(argument, array, "int32")?;
        let indices = Readable::<i32, Ix2>::new(argument, &array)?;
        read_faces(&indices.array.as_array(), &mut faces, wrong)?;
    } else if kind(&array) == 'u' && array.dtype().itemsize() == 4 {
        let array = in_place_or_copy(argument, array, "uint32")?;
        let indices = Readable::<u32, Ix2>::new(argument, &array)?;
        read_faces(&indices.array.as_array(), &mut faces, wrong)?;
    } else {
        let indices = Readable::<i64, Ix2>::new(argument, &integers(argument, array)?)?;
        read_faces(&indices.array.as_array(), &mut faces, wrong)?;
    }
    Ok(faces)
}

fn read_faces<T: Copy + Into<i64>>(
    indices: &ArrayView2<'_, T>,
    faces: &mut Vec<[u32; 3]>,
    wrong: impl Fn(usize, i64) -> PyErr,
) -> PyResult<()> {
    for row in 0..indices.nrows() {
        let mut face = [0; 3];
        for (k, corner) in face.iter_mut().enumerate() {
            let index: i64 = indices[[row, k]].into();
            *corner = u32::try_from(index).map_err(|_| wrong(row, index))?;
        }
        faces.push(face);
    }
    Ok(())
}

/// Integers of any width as i64. Those above 2⁶³ become 2⁶³ − 1, which is out of every range here.
fn integers<'py>(
    argument: &str,
    array: Bound<'py, PyUntypedArray>,
) -> PyResult<Bound<'py, PyUntypedArray>> {
    let array = match (kind(&array), array.dtype().itemsize()) {
        ('i', _) => array,
        ('u', 8) => {
            let numpy = array.py().import("numpy")?;
            let capped = numpy.call_method1("minimum", (&array, i64::MAX.cast_unsigned()))?;
            capped.cast_into::<PyUntypedArray>().or_else(|error| {
                // A scalar, from an array without dimensions.
                as_array(argument, &error.into_inner())
            })?
        }
        ('u', _) => array,
        _ => {
            return Err(wrong_type(
                argument,
                format_args!("expected integers, got an array of dtype {}", array.dtype()),
            ));
        }
    };
    in_place_or_copy(argument, array, "int64")
}

/// An array of any value that NumPy makes one of.
fn as_array<'py>(
    argument: &str,
    value: &Bound<'py, PyAny>,
) -> PyResult<Bound<'py, PyUntypedArray>> {
    if let Ok(array) = value.cast_exact::<PyUntypedArray>() {
        return Ok(array.clone());
    }
    let numpy = value.py().import("numpy")?;
    let array = match numpy.call_method1("asarray", (value,)) {
        Ok(array) => array,
        Err(error) if error.is_instance_of::<pyo3::exceptions::PyException>(value.py()) => {
            return Err(wrong_type(argument, error.value(value.py())));
        }
        Err(error) => return Err(error),
    };
    array
        .cast_into::<PyUntypedArray>()
        .map_err(|_| wrong_type(argument, "expected an array"))
}

/// The array itself if it is of that type and can be read in place, otherwise a copy that can.
fn in_place_or_copy<'py>(
    argument: &str,
    array: Bound<'py, PyUntypedArray>,
    dtype: &str,
) -> PyResult<Bound<'py, PyUntypedArray>> {
    let own = array.dtype();
    let size = own.itemsize().cast_signed();
    let is_in_steps = array
        .strides()
        .iter()
        .all(|stride| size != 0 && stride % size == 0);
    // An empty view may point anywhere.
    let is_empty = array.shape().contains(&0);
    let is_native = own.is_native_byteorder().unwrap_or(false);
    let wanted = numpy::PyArrayDescr::new(array.py(), dtype)?;
    if is_native && own.is_equiv_to(&wanted) && is_in_steps && array.is_aligned() && !is_empty {
        return Ok(array);
    }
    let options = PyDict::new(array.py());
    options.set_item("dtype", wanted)?;
    options.set_item("order", "C")?;
    let numpy = array.py().import("numpy")?;
    let copy = numpy.call_method("array", (&array,), Some(&options))?;
    copy.cast_into::<PyUntypedArray>()
        .map_err(|_| wrong_type(argument, "expected an array"))
}

fn empty_rows(py: Python<'_>) -> PyResult<Bound<'_, PyUntypedArray>> {
    let numpy = py.import("numpy")?;
    Ok(numpy.call_method1("zeros", ((0, 3),))?.cast_into()?)
}

fn kind(array: &Bound<'_, PyUntypedArray>) -> char {
    char::from(array.dtype().kind())
}

fn check_rows(argument: &str, rows: usize) -> PyResult<()> {
    if rows > MOST_ROWS {
        return Err(wrong_value(
            argument,
            format_args!("{rows} rows are too many, one call takes at most {MOST_ROWS}"),
        ));
    }
    Ok(())
}

fn check_shape(argument: &str, shape: &[usize], rows: usize) -> PyResult<()> {
    if shape == [rows] {
        return Ok(());
    }
    let shape = shape_of(shape);
    Err(wrong_value(
        argument,
        format_args!("expected one number or an array of shape ({rows},), got {shape}"),
    ))
}

/// A shape as Python writes it.
fn shape_of(shape: &[usize]) -> String {
    match shape {
        [one] => format!("({one},)"),
        _ => {
            let all: Vec<String> = shape.iter().map(usize::to_string).collect();
            format!("({})", all.join(", "))
        }
    }
}

/// A vector with room for `rows`; an exception where the system lacks the memory.
pub(crate) fn reserved<T>(rows: usize, what: &str) -> PyResult<Vec<T>> {
    let mut rows_of = Vec::new();
    rows_of
        .try_reserve_exact(rows)
        .map_err(|_| no_memory(what))?;
    Ok(rows_of)
}

/// A new array of zeros, to write to.
pub(crate) fn zeros<'py, T: Element>(
    py: Python<'py>,
    len: usize,
) -> PyResult<Bound<'py, PyArray1<T>>> {
    let array = py
        .import("numpy")?
        .call_method1("zeros", (len, T::get_dtype(py)))?;
    Ok(array.cast_into()?)
}

/// A new array of zeros with three numbers in each row.
pub(crate) fn zero_rows<'py, T: Element>(
    py: Python<'py>,
    len: usize,
) -> PyResult<Bound<'py, numpy::PyArray2<T>>> {
    let array = py
        .import("numpy")?
        .call_method1("zeros", ((len, 3), T::get_dtype(py)))?;
    Ok(array.cast_into()?)
}

/// A new array with three numbers in each row.
pub(crate) fn array_of_rows<'py, T: Element + Copy>(
    py: Python<'py>,
    all: &[[T; 3]],
) -> PyResult<Bound<'py, numpy::PyArray2<T>>> {
    let array = zero_rows::<T>(py, all.len())?;
    array
        .readwrite()
        .as_slice_mut()
        .expect("a new array")
        .copy_from_slice(all.as_flattened());
    Ok(array)
}

/// A small matrix with four columns.
pub(crate) struct Matrix(Vec<[f64; 4]>);

impl Matrix {
    pub(crate) fn new(argument: &str, value: &Bound<'_, PyAny>) -> PyResult<Self> {
        let array = as_array(argument, value)?;
        if !matches!(kind(&array), 'f' | 'i' | 'u') {
            return Err(wrong_type(
                argument,
                format_args!("expected floats, got an array of dtype {}", array.dtype()),
            ));
        }
        let [_, 4] = *array.shape() else {
            let shape = shape_of(array.shape());
            return Err(wrong_value(
                argument,
                format_args!("expected a matrix with four columns, got {shape}"),
            ));
        };
        let array = in_place_or_copy(argument, array, "float64")?;
        let matrix = Readable::<f64, Ix2>::new(argument, &array)?;
        let matrix = matrix.array.as_array();
        let rows = 0..matrix.nrows().min(5);
        Ok(Self(
            rows.map(|i| [0, 1, 2, 3].map(|k| matrix[[i, k]])).collect(),
        ))
    }

    /// Its rows, five at most.
    pub(crate) fn rows(&self) -> &[[f64; 4]] {
        &self.0
    }
}

/// One array of all parts, copied by some threads.
pub(crate) fn joined<'py, T: Element + Copy, P: AsRef<[T]> + Sync>(
    py: Python<'py>,
    parts: &[P],
    threads: usize,
) -> PyResult<Bound<'py, PyArray1<T>>> {
    let array = zeros::<T>(py, parts.iter().map(|part| part.as_ref().len()).sum())?;
    let mut all = array.readwrite();
    let mut rest = all.as_slice_mut().expect("a new array");
    let mut copies = Vec::with_capacity(parts.len());
    for part in parts {
        let (own, others) = rest.split_at_mut(part.as_ref().len());
        copies.push((own, part.as_ref()));
        rest = others;
    }
    // Parts are runs of thousands of rays, about equally long.
    each_on_threads(&mut copies, threads, |(to, from)| to.copy_from_slice(from));
    drop(all);
    Ok(array)
}

/// Six floats in each row, in f32.
pub(crate) struct SixColumns<'py>(Readable<'py, f32, Ix2>);

impl<'py> SixColumns<'py> {
    /// An argument of shape (N, 6).
    pub(crate) fn new(argument: &str, value: &Bound<'py, PyAny>) -> PyResult<Self> {
        let array = as_array(argument, value)?;
        if !matches!(kind(&array), 'f' | 'i' | 'u') {
            return Err(wrong_type(
                argument,
                format_args!("expected floats, got an array of dtype {}", array.dtype()),
            ));
        }
        let [rows, 6] = *array.shape() else {
            let shape = shape_of(array.shape());
            return Err(wrong_value(
                argument,
                format_args!("expected an array of shape (N, 6), got {shape}"),
            ));
        };
        check_rows(argument, rows)?;
        let array = in_place_or_copy(argument, array, "float32")?;
        Ok(Self(Readable::new(argument, &array)?))
    }

    pub(crate) fn len(&self) -> usize {
        self.0.array.len() / 6
    }

    pub(crate) fn view(&self) -> SixColumnsView<'_> {
        SixColumnsView(self.0.array.as_array())
    }
}

/// [`SixColumns`], ready to be read.
pub(crate) struct SixColumnsView<'a>(ArrayView2<'a, f32>);

impl SixColumnsView<'_> {
    /// Calls `each` with rows from `start` on.
    pub(crate) fn for_each(&self, start: usize, count: usize, mut each: impl FnMut([f32; 6])) {
        let Self(rows) = self;
        if let Some(all) = rows.as_slice() {
            let (rows, _) = all.as_chunks::<6>();
            rows[start..start + count].iter().for_each(|row| each(*row));
            return;
        }
        for i in start..start + count {
            each([0, 1, 2, 3, 4, 5].map(|k| rows[[i, k]]));
        }
    }
}
