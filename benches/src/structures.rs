//! What structures other than kd-trees cost and are worth, over rivals and over our default tree, with goals.

use crate::peers;
use crate::scene_table::{SceneTable, SceneTableArgs};
use crate::view::View;

/// Scanned meshes, for which the goals are set, and others for comparison, in a folder of meshes.
const SCENES: [&str; 7] = [
    "bunny",
    "dragon_res2",
    "dragon_res4",
    "ogre",
    "sponza_dabrovic",
    "sibenik",
    "munich",
];

/// Measures, prints and writes; false if an answer is wrong.
pub(crate) fn run(arguments: &SceneTableArgs) -> anyhow::Result<bool> {
    peers::check_available()?;
    let command = SceneTable {
        usual: Some(&SCENES),
        with_rooms: false,
        view: View::named(&["structures"], ("", ""))?,
        file: "structures.jsonl",
        note: "and their geometric mean; one ray at a time, on one thread; speeds are geometric means over primary, shadow, AO, \
               diffuse and random rays",
        rays: if arguments.smoke {
            (32, 1 << 8)
        } else {
            (192, 1 << 14)
        },
        leaves_out: |_, _| false,
    };
    arguments.run(&command, |_, _| Ok(()), |_, _| Ok(String::new()))
}

#[cfg(test)]
mod tests {
    use crate::view::{cell, table_with};

    #[test]
    fn rows_have_their_goals() {
        let (obvhs, balanced) = ("obvhs/medium/own", "kd/balanced/wide");
        let cells = [("a", 0.5), ("b", 2.0)].map(|(scene, factor)| {
            [
                cell(scene, "grid/exact/own", "", "embree/low/own", 0.6 * factor),
                cell(scene, "grid/boxes/own", "", "embree/low/own", 0.4 * factor),
                cell(scene, "bvh/objects/wide", "ao", obvhs, 4.0),
                cell(scene, "bvh/objects/wide", "random", obvhs, 1.0),
                cell(scene, "bsp/polygon/own", "primary", balanced, 4.0),
            ]
        });
        let rows = [
            ("build time, grid/exact / Embree low", 0.6, false),
            ("build time, grid/boxes / Embree low", 0.4, true),
            ("speed of rays, bvh/objects/wide / obvhs", 0.5, false),
            ("speed of rays, bsp/polygon / balanced", 0.25, true),
        ];
        let table = table_with("structures", &cells.concat(), &rows);
        let unknown = table.row("speed-up on two threads, grid/exact").is_met();
        assert_eq!(unknown, None, "not measured");
    }
}
