//! What every reader of untrusted bytes must keep to, whatever the bytes.

use kd_core::Mesh;
use kd_scene::LoadError;

/// Reads twice. A mesh must be valid and no larger than its file allows, an error must name the
/// file and be short, and both readings must agree.
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
                "a bad index"
            );
            // Every vertex and every triangle has taken at least one byte.
            assert!(
                vertices <= bytes.len() && mesh.len() <= bytes.len(),
                "more mesh than file"
            );
        }
        (Err(error), Err(again)) => {
            let text = error.to_string();
            assert_eq!(text, again.to_string(), "two readings differ");
            assert!(text.starts_with("fuzz: "), "no file name: {text}");
            assert!(
                text.len() < 1000 && !text.contains('\n'),
                "a long error: {text}"
            );
        }
        _ => panic!("two readings differ: {first:?} and {second:?}"),
    }
}
