//! Which variants a run measures.

use crate::cli::{BenchArgs, UsageError, name_of};
use crate::structure::{BuilderName, LayoutName, StructureName, Variant};
use clap::ValueEnum as _;

/// Every chosen structure with every chosen builder that it has, and in every chosen layout where it has several.
pub(crate) fn choose(arguments: &BenchArgs) -> anyhow::Result<Vec<Variant>> {
    let structures = structures(arguments)?;
    let mut variants: Vec<Variant> = Vec::new();
    for structure in structures {
        for builder in builders(arguments, structure) {
            let layouts = match builder {
                BuilderName::Objects => &[LayoutName::Wide],
                _ if structure.has_layouts() && !builder.is_of_rival() => {
                    arguments.layout.as_slice()
                }
                _ => &[LayoutName::Own],
            };
            variants.extend(layouts.iter().map(|layout| Variant {
                structure,
                builder,
                layout: *layout,
            }));
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
            all.filter(|structure| peers || !structure.is_rival())
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
    if arguments.peers {
        return vec![BuilderName::Fast, BuilderName::Balanced, BuilderName::Best];
    }
    vec![
        BuilderName::Median,
        BuilderName::Exact,
        BuilderName::Balanced,
    ]
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
    use clap::Parser as _;

    use super::*;
    use crate::cli::{Cli, Command};

    fn chosen(arguments: &[&str]) -> Result<String, String> {
        let all = [&["kd-bench", "bench"], arguments].concat();
        let Command::Bench(arguments) = Cli::try_parse_from(all).expect("valid").command else {
            panic!("asked for bench");
        };
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
        let usual = "kd/median/wide kd/exact/wide kd/balanced/wide";
        assert_eq!(chosen(&[]).as_deref(), Ok(usual), "the usual three");
        let smoke = chosen(&["--smoke"]).expect("all");
        assert!(
            smoke.contains("kd/naive/wide")
                && smoke.contains("octree/median/own")
                && !smoke.contains("default"),
            "all of its own: {smoke}"
        );
        let twice = chosen(&["--builder", "exact,exact"]);
        assert_eq!(twice.as_deref(), Ok("kd/exact/wide"), "once");
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
    fn what_cannot_be_is_refused_with_what_can() {
        let refused = chosen(&["--structure", "kd,embree"]).expect_err("a rival");
        assert_eq!(
            refused, "`embree` is a rival library: add --peers",
            "what to do"
        );
        let refused = chosen(&["--builder", "medium"]).expect_err("of rivals only");
        assert!(
            refused.contains("kd has median") && refused.ends_with("best"),
            "{refused}"
        );
    }
}
