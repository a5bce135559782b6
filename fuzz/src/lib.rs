//! The contract that every mesh reader must keep for all input bytes.

use kd_core::Mesh;
use kd_scene::LoadError;

/// Reads `bytes` twice with the file name `fuzz`, and checks the result.
///
/// # Panics
///
/// If the two results differ, if a mesh has a position that is not finite, an index out of range, or more vertices or triangles
/// than the file has bytes, or if an error text does not start with the file name, has several lines, or has 1000 bytes or
/// more.
pub fn check(bytes: &[u8], read: impl Fn(&[u8]) -> Result<Mesh, LoadError>) {
    let (first, second) = (read(bytes), read(bytes));
    match (&first, &second) {
        (Ok(mesh), Ok(again)) => {
            assert_eq!(mesh, again, "two readings differ");
            let finite = |position: &[f32; 3]| position.iter().all(|number| number.is_finite());
            assert!(
                mesh.positions().iter().all(finite),
                "a position is not finite"
            );
            let vertices = mesh.positions().len();
            let corners = mesh.triangles().iter().flatten();
            assert!(
                corners.copied().all(|corner| (corner as usize) < vertices),
                "an index is out of range"
            );
            // Every vertex and every triangle takes at least one byte of the file.
            assert!(
                vertices <= bytes.len() && mesh.len() <= bytes.len(),
                "{vertices} vertices and {} triangles from {} bytes",
                mesh.len(),
                bytes.len()
            );
        }
        (Err(error), Err(again)) => {
            let text = error.to_string();
            assert_eq!(text, again.to_string(), "two readings differ");
            assert!(
                text.starts_with("fuzz: "),
                "error without the file name: {text}"
            );
            assert!(
                text.len() < 1000 && !text.contains('\n'),
                "error longer than a line: {text}"
            );
        }
        _ => panic!("two readings differ: {first:?} and {second:?}"),
    }
}
