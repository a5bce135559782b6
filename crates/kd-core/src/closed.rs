//! Whether a surface is closed.

use crate::Mesh;

impl Mesh {
    /// Whether the surface is closed and consistently wound: each edge is used as often in one direction as in the other. True for a mesh
    /// without triangles.
    ///
    /// Vertices at equal positions are one vertex, so that a list of triangles with vertices of their own can be closed. Any even number of
    /// triangles may meet at an edge. Triangles of zero area count: one that fills the gap beside a vertex on an edge closes it.
    ///
    /// O(N log N) in the number of triangles, with 28 bytes of memory for each edge.
    ///
    /// ```
    /// use kd_core::Mesh;
    ///
    /// let corners = vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    /// let mut faces = vec![[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]];
    /// assert!(Mesh::new(corners.clone(), faces.clone())?.is_closed());
    /// faces.pop();
    /// assert!(!Mesh::new(corners, faces)?.is_closed(), "a hole");
    /// # Ok::<(), kd_core::MeshError>(())
    /// ```
    pub fn is_closed(&self) -> bool {
        // Adding zero turns -0.0 into 0.0, which is the same place.
        let place = |index: u32| self.positions()[index as usize].map(|x| (x + 0.0).to_bits());
        let mut edges: Vec<([[u32; 3]; 2], bool)> = Vec::with_capacity(3 * self.len());
        for &[a, b, c] in self.triangles() {
            for (from, to) in [(a, b), (b, c), (c, a)] {
                let (from, to) = (place(from), place(to));
                // An edge without length goes both ways at once.
                if from != to {
                    edges.push(([from.min(to), from.max(to)], from < to));
                }
            }
        }
        edges.sort_unstable();
        edges
            .chunk_by(|(edge, _), (other, _)| edge == other)
            .all(|uses| {
                let forwards = uses.iter().filter(|(_, is_forwards)| *is_forwards).count();
                2 * forwards == uses.len()
            })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const CORNERS: [[f32; 3]; 4] = [
        [0.0, 0.0, 0.0],
        [1.0, 0.0, 0.0],
        [0.0, 1.0, 0.0],
        [0.0, 0.0, 1.0],
    ];
    const FACES: [[u32; 3]; 4] = [[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]];

    fn mesh(triangles: &[[u32; 3]]) -> Mesh {
        Mesh::new(CORNERS.to_vec(), triangles.to_vec()).expect("valid")
    }

    #[test]
    fn edges_are_counted_by_direction() {
        assert!(mesh(&FACES).is_closed(), "a tetrahedron");
        assert!(mesh(&[]).is_closed(), "nothing");
        assert!(mesh(&[FACES, FACES].concat()).is_closed(), "twice");
        assert!(mesh(&[[0, 1, 2], [0, 2, 1]]).is_closed(), "two sides");
        assert!(!mesh(&FACES[..3]).is_closed(), "a hole");
        let [a, b, c] = FACES[3];
        let turned = [FACES[0], FACES[1], FACES[2], [a, c, b]];
        assert!(!mesh(&turned).is_closed(), "one face is turned over");
        assert!(
            mesh(&[&FACES[..], &[[0, 1, 1]]].concat()).is_closed(),
            "a segment"
        );
    }

    #[test]
    fn equal_positions_are_one_vertex() {
        let corners = FACES.as_flattened().iter().map(|i| {
            // Some zeros are negative.
            CORNERS[*i as usize].map(|x| if x == 0.0 && i % 2 == 0 { -0.0 } else { x })
        });
        let triangles = vec![[0, 1, 2], [3, 4, 5], [6, 7, 8], [9, 10, 11]];
        let soup = Mesh::new(corners.collect(), triangles).expect("valid");
        assert!(soup.is_closed(), "four triangles with corners of their own");
    }
}
