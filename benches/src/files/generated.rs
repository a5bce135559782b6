//! A wavy sheet of triangles, written in each format.

use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::Path;

use super::Kind;

/// A square grid of vertices with two triangles in each cell.
pub(super) struct Sheet {
    /// Cells along a side.
    side: usize,
}

impl Sheet {
    /// A sheet whose file has about `bytes` bytes.
    pub(super) fn of_size(bytes: u64, kind: Kind) -> Self {
        // Bytes of a cell: a vertex and two triangles.
        let cell = match kind {
            Kind::PlyBinary => 38.0,
            Kind::PlyText | Kind::Off => 65.0,
            Kind::StlBinary => 100.0,
            Kind::StlText => 400.0,
            Kind::Obj => 75.0,
            Kind::ObjFull => 200.0,
        };
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "a file has few bytes"
        )]
        let side = (bytes as f64 / cell).sqrt() as usize;
        Self { side: side.max(1) }
    }

    pub(super) fn triangles(&self) -> usize {
        2 * self.side * self.side
    }

    fn vertices(&self) -> usize {
        (self.side + 1) * (self.side + 1)
    }

    fn position(&self, vertex: usize) -> [f32; 3] {
        let across = self.side + 1;
        let (x, y) = (vertex % across, vertex / across);
        let height = (x * 7919 + y * 104_729) % 1000;
        [x as f32 * 0.01, y as f32 * 0.01, height as f32 * 0.001]
    }

    fn corners(&self, triangle: usize) -> [usize; 3] {
        let (cell, across) = (triangle / 2, self.side + 1);
        let first = cell / self.side * across + cell % self.side;
        if triangle.is_multiple_of(2) {
            [first, first + 1, first + across + 1]
        } else {
            [first, first + across + 1, first + across]
        }
    }

    pub(super) fn write(&self, path: &Path, kind: Kind) -> io::Result<()> {
        let mut file = BufWriter::with_capacity(1 << 20, File::create(path)?);
        match kind {
            Kind::PlyBinary => self.write_ply(&mut file, true)?,
            Kind::PlyText => self.write_ply(&mut file, false)?,
            Kind::StlBinary => self.write_binary_stl(&mut file)?,
            Kind::StlText => self.write_text_stl(&mut file)?,
            Kind::Obj => self.write_obj(&mut file, false)?,
            Kind::ObjFull => self.write_obj(&mut file, true)?,
            Kind::Off => {
                writeln!(file, "OFF\n{} {} 0", self.vertices(), self.triangles())?;
                self.write_words(&mut file, "", "3 ", 0)?;
            }
        }
        file.flush()
    }

    /// Vertices and triangles, a line each. The index of the first vertex is `first`.
    fn write_words(
        &self,
        file: &mut impl Write,
        vertex: &str,
        face: &str,
        first: usize,
    ) -> io::Result<()> {
        for number in 0..self.vertices() {
            let [x, y, z] = self.position(number);
            writeln!(file, "{vertex}{x} {y} {z}")?;
        }
        for number in 0..self.triangles() {
            let [a, b, c] = self.corners(number).map(|corner| corner + first);
            writeln!(file, "{face}{a} {b} {c}")?;
        }
        Ok(())
    }

    fn write_ply(&self, file: &mut impl Write, is_binary: bool) -> io::Result<()> {
        let format = if is_binary {
            "binary_little_endian"
        } else {
            "ascii"
        };
        let (vertices, triangles) = (self.vertices(), self.triangles());
        writeln!(
            file,
            "ply\nformat {format} 1.0\nelement vertex {vertices}\nproperty float x\nproperty float y\nproperty float z\n\
             element face {triangles}\nproperty list uchar int vertex_indices\nend_header"
        )?;
        if !is_binary {
            return self.write_words(file, "", "3 ", 0);
        }
        for vertex in 0..vertices {
            for coordinate in self.position(vertex) {
                file.write_all(&coordinate.to_le_bytes())?;
            }
        }
        for triangle in 0..triangles {
            file.write_all(&[3])?;
            for corner in self.corners(triangle) {
                file.write_all(&as_u32(corner)?.to_le_bytes())?;
            }
        }
        Ok(())
    }

    fn write_binary_stl(&self, file: &mut impl Write) -> io::Result<()> {
        file.write_all(&[b' '; 80])?;
        file.write_all(&as_u32(self.triangles())?.to_le_bytes())?;
        for triangle in 0..self.triangles() {
            file.write_all(&[0; 12])?;
            for coordinate in self
                .corners(triangle)
                .map(|corner| self.position(corner))
                .iter()
                .flatten()
            {
                file.write_all(&coordinate.to_le_bytes())?;
            }
            file.write_all(&[0; 2])?;
        }
        Ok(())
    }

    fn write_text_stl(&self, file: &mut impl Write) -> io::Result<()> {
        writeln!(file, "solid sheet")?;
        for triangle in 0..self.triangles() {
            writeln!(file, " facet normal 0 0 1\n  outer loop")?;
            for [x, y, z] in self.corners(triangle).map(|corner| self.position(corner)) {
                writeln!(file, "   vertex {x:e} {y:e} {z:e}")?;
            }
            writeln!(file, "  endloop\n endfacet")?;
        }
        writeln!(file, "endsolid sheet")
    }

    fn write_obj(&self, file: &mut impl Write, is_full: bool) -> io::Result<()> {
        if !is_full {
            return self.write_words(file, "v ", "f ", 1);
        }
        for vertex in 0..self.vertices() {
            let [x, y, z] = self.position(vertex);
            writeln!(
                file,
                "v {x:.6} {y:.6} {z:.6}\nvt {x:.6} {y:.6}\nvn 0.0000 0.7071 0.7071"
            )?;
        }
        for triangle in 0..self.triangles() {
            let [a, b, c] = self.corners(triangle).map(|corner| corner + 1);
            writeln!(file, "f {a}/{a}/{a} {b}/{b}/{b} {c}/{c}/{c}")?;
        }
        Ok(())
    }
}

fn as_u32(number: usize) -> io::Result<u32> {
    u32::try_from(number).map_err(io::Error::other)
}
