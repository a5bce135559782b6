//! The variants of a run.

use clap::ValueEnum as _;

use super::BenchArgs;
use crate::arguments::{UsageError, name_of};
use crate::names::{BuilderName, LayoutName, StructureName, Variant};

/// Every chosen structure with every chosen builder that it has, in every chosen layout if it has several.
///
/// Without `--layout`, builders of kd-trees are traced through the tree that they built, since wide nodes divide small cells
/// again and hide the differences; presets and hierarchies are traced through wide nodes, which is the default of users.
pub(crate) fn choose(arguments: &BenchArgs) -> anyhow::Result<Vec<Variant>> {
    let structures = structures(arguments)?;
    let mut variants: Vec<Variant> = Vec::new();
    for structure in structures {
        for builder in builders(arguments, structure) {
            let layouts: &[LayoutName] = match (structure, builder) {
                (_, BuilderName::Objects) => &[LayoutName::Wide],
                _ if !structure.has_layouts() || builder.is_of_rival() => &[LayoutName::Own],
                _ if !arguments.layout.is_empty() => &arguments.layout,
                (StructureName::Kd, builder) if !builder.is_preset() => &[LayoutName::Binary],
                _ => &[LayoutName::Wide],
            };
            let in_layout = |layout: &LayoutName| Variant::new(structure, builder, *layout);
            variants.extend(layouts.iter().map(in_layout));
        }
    }
    if variants.is_empty() {
        return Err(UsageError(nothing_left(arguments)).into());
    }
    Ok(without_repeats(&variants))
}

fn structures(arguments: &BenchArgs) -> Result<Vec<StructureName>, UsageError> {
    if let Some(rival) = arguments.structure.iter().find(|s| s.is_rival())
        && !arguments.peers
    {
        let message = format!("`{}` is a rival library: add --peers", name_of(rival));
        return Err(UsageError(message));
    }
    Ok(match (arguments.structure.as_slice(), arguments.peers) {
        ([], false) if !arguments.smoke => vec![StructureName::Kd],
        ([], peers) => {
            let all = StructureName::value_variants().iter().copied();
            // Few programs contain tinybvh.
            all.filter(|structure| *structure != StructureName::Tinybvh)
                .filter(|structure| peers || !structure.is_rival())
                .collect()
        }
        (chosen, _) => chosen.to_vec(),
    })
}

fn builders(arguments: &BenchArgs, structure: StructureName) -> Vec<BuilderName> {
    let mut all = structure.builders();
    all.retain(|builder| arguments.peers || !builder.is_of_rival());
    if !arguments.builder.is_empty() {
        let chosen = arguments.builder.iter().copied();
        return chosen.filter(|name| all.contains(name)).collect();
    }
    if structure != StructureName::Kd || arguments.smoke {
        return all;
    }
    use BuilderName::{Balanced, Best, Binned, Exact, Fast, Median};
    if arguments.peers {
        return vec![Fast, Balanced, Best];
    }
    vec![Median, Binned, Exact, Fast, Balanced, Best]
}

fn nothing_left(arguments: &BenchArgs) -> String {
    let structures = if arguments.structure.is_empty() {
        vec![StructureName::Kd]
    } else {
        arguments.structure.clone()
    };
    let offers = structures.iter().map(|structure| {
        let names: Vec<String> = structure.builders().iter().map(name_of).collect();
        format!("{} has {}", name_of(structure), names.join(", "))
    });
    let offers: Vec<String> = offers.collect();
    format!(
        "no chosen structure has a chosen builder: {}",
        offers.join("; ")
    )
}

/// The values in order, each once.
pub(crate) fn without_repeats<T: Copy + PartialEq>(values: &[T]) -> Vec<T> {
    let mut once: Vec<T> = Vec::new();
    for value in values {
        if !once.contains(value) {
            once.push(*value);
        }
    }
    once
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sweep::parsed;

    fn chosen(arguments: &[&str]) -> Result<String, String> {
        let arguments = parsed(arguments.iter().copied());
        let variants = choose(&arguments).map_err(|why| why.to_string())?;
        let names: Vec<String> = variants.iter().map(ToString::to_string).collect();
        Ok(names.join(" "))
    }

    #[test]
    fn the_crate_bvh_is_a_rival_of_the_structure_bvh() {
        let ours = chosen(&["--structure", "bvh,grid", "--layout", "binary,wide"]).expect("ours");
        assert!(
            ours.starts_with("bvh/objects/wide bvh/binned/binary bvh/binned/wide bvh/sweep/binary"),
            "{ours}"
        );
        assert!(
            ours.ends_with("grid/exact/own grid/boxes/own") && !ours.contains("default"),
            "{ours}"
        );
        let all = chosen(&["--structure", "bvh", "--peers"]).expect("both");
        assert!(
            all.ends_with("bvh/equal-counts/wide bvh/default/own"),
            "{all}"
        );
    }

    #[test]
    fn without_rivals_there_is_the_kd_tree() {
        let usual = "kd/median/binary kd/binned/binary kd/exact/binary kd/fast/wide kd/balanced/wide kd/best/wide";
        assert_eq!(chosen(&[]).as_deref(), Ok(usual), "builders and presets");
        let wide = chosen(&["--layout", "wide", "--builder", "exact,best"]);
        assert_eq!(
            wide.as_deref(),
            Ok("kd/exact/wide kd/best/wide"),
            "as chosen"
        );
        let smoke = chosen(&["--smoke"]).expect("all");
        assert!(
            smoke.contains("kd/naive/binary")
                && smoke.contains("octree/median/own")
                && !smoke.contains("default"),
            "all of its own: {smoke}"
        );
        let twice = chosen(&["--builder", "exact,exact"]);
        assert_eq!(twice.as_deref(), Ok("kd/exact/binary"), "once");
    }

    #[test]
    fn builders_are_those_that_a_structure_has() {
        let all = chosen(&["--peers"]).expect("all");
        for part in [
            "kd/best/wide",
            "embree-robust/medium/own",
            "parry3d/default/own",
        ] {
            assert!(all.contains(part), "{part} in {all}");
        }
        assert!(!all.contains("tinybvh"), "not named: {all}");
        let named = chosen(&["--peers", "--structure", "tinybvh"]);
        let expected = "tinybvh/medium/own tinybvh/high/own";
        assert_eq!(named.as_deref(), Ok(expected), "all of its builds");
        let some = [
            "--peers",
            "--structure",
            "kd,embree,bvh",
            "--builder",
            "medium,best",
        ];
        assert_eq!(
            chosen(&some).as_deref(),
            Ok("kd/best/wide embree/medium/own"),
            "bvh has neither"
        );
    }

    #[test]
    fn a_refusal_names_the_alternatives() {
        let refused = chosen(&["--structure", "kd,embree"]).expect_err("a rival");
        assert_eq!(
            refused, "`embree` is a rival library: add --peers",
            "the remedy"
        );
        let refused = chosen(&["--builder", "medium"]).expect_err("of rivals only");
        assert!(
            refused.contains("kd has median") && refused.ends_with("best"),
            "{refused}"
        );
    }
}
