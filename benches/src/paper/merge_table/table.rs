//! What was measured of frames, printed: milliseconds beside those of the paper, ratios with their goals, JSON lines and a plot.

use anyhow::Context as _;
use serde_json::{Value, json};

use super::{
    AUTO, BEST, EMBREE_MEDIUM, EMBREE_NAMES, EMBREE_REFIT, EmbreeFigures, FAST, FrameFigures,
    MERGE, OF_PAPER, SEED, WAYS,
};
use crate::animation::Animation;
use crate::goals::{Goal, Row, Table, maximum, minimum};
use crate::plots::{Axis, LinePlot};
use crate::terminal;

/// Milliseconds, and those of the paper beside them.
pub(super) fn times(figures: &[FrameFigures], is_of_seed: bool) -> String {
    let mut head: Vec<String> = ["row", "frame", "copy", "dynamic", "merge", "trace"]
        .map(String::from)
        .into();
    head.extend(["best", "trace", "balanced", "fast"].map(String::from));
    if is_of_seed {
        let seed = ["copy", "dynamic", "merge", "trace", "rebuild", "trace"];
        head.extend(seed.map(|name| format!("seed {name}")));
    }
    let mut table = terminal::empty_table(head);
    for figures in figures {
        let way = &figures.ways[MERGE];
        let merge_ms = way.update_ms - figures.dynamic_ms;
        let [best, balanced, fast] = figures.rebuild_ms;
        let mut cells = vec![figures.label.clone(), figures.frame.to_string(), "0".into()];
        cells.extend([figures.dynamic_ms, merge_ms].map(|ms| format!("{ms:.2}")));
        let others = [way.trace_ms, best, figures.rebuild_trace_ms, balanced, fast];
        cells.extend(others.map(|ms| format!("{ms:.0}")));
        let seed = SEED
            .iter()
            .find(|(row, _)| is_of_seed && row.to_string() == figures.label);
        if let Some((_, seed)) = seed {
            cells.extend(seed.map(|ms| format!("{ms:.0}")));
        }
        table.add_row(cells);
    }
    terminal::align_right(&mut table, 1);
    format!("milliseconds\n{table}")
}

/// Ratios with their goals.
pub(super) fn ratios(figures: &[FrameFigures]) -> Table {
    let mut rows = Vec::new();
    let mut row = |name: String, goal: Goal, value: &dyn Fn(&FrameFigures) -> Option<f64>| {
        let values = figures.iter().map(value).collect();
        let of_all = match goal {
            Goal::AtMost(_) => maximum,
            Goal::AtLeast(_) => minimum,
            Goal::None => crate::goals::geometric_mean,
        };
        rows.push(Row::new(name, goal, values, of_all));
    };
    row(
        "merge: updates in the time of `best`".into(),
        Goal::AtLeast(25.0),
        &|f| Some(f.ways[MERGE].rebuilds[BEST]),
    );
    row(
        "merge: updates in the time of `fast`".into(),
        Goal::AtLeast(6.0),
        &|f| Some(f.ways[MERGE].rebuilds[FAST]),
    );
    for (way, (name, _)) in WAYS.iter().enumerate() {
        let goal = if way == MERGE {
            Goal::AtMost(1.02)
        } else {
            Goal::None
        };
        row(format!("{name}: time of rays / `best`"), goal, &|f| {
            Some(f.ways[way].trace)
        });
    }
    for (way, (name, _)) in WAYS.iter().enumerate() {
        row(format!("{name}: update, ms"), Goal::None, &|f| {
            Some(f.ways[way].update_ms)
        });
    }
    for way in OF_PAPER {
        let name = format!("{}, with a copy as in the paper: update, ms", WAYS[way].0);
        row(name, Goal::None, &|f| {
            Some(f.ways[way].update_ms + f.still_copy_ms)
        });
    }
    if figures.iter().any(|figures| !figures.embree.is_empty()) {
        row(
            "merge: update / Embree's, medium".into(),
            Goal::AtMost(1.0),
            &|f| Some(f.embree[EMBREE_MEDIUM].our_updates[0]),
        );
        row(
            "auto: update / Embree's, refit".into(),
            Goal::AtMost(1.0),
            &|f| Some(f.embree[EMBREE_REFIT].our_updates[1]),
        );
        let best_total = |f: &FrameFigures, trace: fn(&EmbreeFigures) -> f64| {
            let totals = f.embree.iter().map(|e| e.update_ms + trace(e));
            minimum(&totals.collect::<Vec<_>>())
        };
        row(
            "auto: best total of Embree, single / ours".into(),
            Goal::AtLeast(1.4),
            &|f| {
                let ours = f.ways[AUTO].update_ms + f.ways[AUTO].trace_ms;
                Some(best_total(f, |e| e.trace_ms) / ours)
            },
        );
        row(
            "auto: best total of Embree, packets / ours, batches".into(),
            Goal::AtLeast(1.2),
            &|f| {
                let ours = f.ways[AUTO].update_ms + f.ways[AUTO].batch_ms;
                Some(best_total(f, |e| e.packets_ms) / ours)
            },
        );
        for (place, name) in EMBREE_NAMES.into_iter().enumerate() {
            row(format!("Embree {name}: update, ms"), Goal::None, &|f| {
                Some(f.embree[place].update_ms)
            });
            row(format!("Embree {name}: trace, ms"), Goal::None, &|f| {
                Some(f.embree[place].trace_ms)
            });
            row(
                format!("Embree {name}: trace in packets, ms"),
                Goal::None,
                &|f| Some(f.embree[place].packets_ms),
            );
        }
    }
    row(
        "lazy: building and tracing / `best`".into(),
        Goal::None,
        &|f| Some(f.lazy),
    );
    row("grid: build / `Auto`'s update".into(), Goal::None, &|f| {
        Some(f.grid.updates)
    });
    row("grid: time of rays / `best`".into(), Goal::None, &|f| {
        Some(f.grid.trace)
    });
    row("`best`: trace, ms".into(), Goal::None, &|f| {
        Some(f.rebuild_trace_ms)
    });
    row("`best`: trace in batches, ms".into(), Goal::None, &|f| {
        Some(f.rebuild_batch_ms)
    });
    Table {
        scenes: figures
            .iter()
            .map(|figures| figures.label.clone())
            .collect(),
        rows,
    }
}

pub(super) fn to_lines(
    animation: &Animation,
    figures: &[FrameFigures],
    is_of_seed: bool,
) -> anyhow::Result<String> {
    let mut lines = String::new();
    for figures in figures {
        let seed = SEED
            .iter()
            .find(|(row, _)| is_of_seed && row.to_string() == figures.label);
        let seed = seed.map_or(Value::Null, |(frame, ms)| {
            json!({
                "frame": frame, "copy_ms": ms[0], "dynamic_ms": ms[1], "merge_ms": ms[2], "trace_ms": ms[3],
                "rebuild_ms": ms[4], "rebuild_trace_ms": ms[5],
            })
        });
        for ((name, _), way) in WAYS.iter().zip(&figures.ways) {
            let builds = matches!(*name, "merge" | "dual");
            let dynamic_ms = if builds { figures.dynamic_ms } else { 0.0 };
            let mut ours = json!({
                "scene": animation.name,
                "frame": figures.frame,
                "strategy": name,
                "copy_ms": 0.0,
                "still_copy_ms": figures.still_copy_ms,
                "dynamic_ms": dynamic_ms,
                "merge_ms": way.update_ms - dynamic_ms,
                "trace_ms": way.trace_ms,
                "trace_batch_ms": way.batch_ms,
                "trace_over_best": way.trace,
                "rebuild_best_ms": figures.rebuild_ms[0],
                "rebuild_balanced_ms": figures.rebuild_ms[1],
                "rebuild_fast_ms": figures.rebuild_ms[2],
                "rebuild_trace_ms": figures.rebuild_trace_ms,
                "grid_build_ms": figures.grid.build_ms,
                "grid_build_over_auto_update": figures.grid.updates,
                "grid_trace_over_best": figures.grid.trace,
            });
            let fields = ours.as_object_mut().context("an object")?;
            for (name, embree) in EMBREE_NAMES.iter().zip(&figures.embree) {
                fields.insert(format!("embree_{name}_update_ms"), embree.update_ms.into());
                fields.insert(format!("embree_{name}_trace_ms"), embree.trace_ms.into());
                let packets = format!("embree_{name}_packets_ms");
                fields.insert(packets, embree.packets_ms.into());
            }
            let following = match *name {
                "merge" | "dual" => EMBREE_MEDIUM,
                _ => EMBREE_REFIT,
            };
            if let Some(embree) = figures.embree.get(following) {
                fields.insert("embree_update_ms".into(), embree.update_ms.into());
                fields.insert("embree_trace_ms".into(), embree.trace_ms.into());
            }
            let line = json!({
                "table": "merge-table", "row": figures.label, "seed": seed, "ours": ours,
            });
            lines += &serde_json::to_string(&line)?;
            lines.push('\n');
        }
    }
    Ok(lines)
}

/// By row: updates in milliseconds, and times of rays over `best` in percent.
pub(super) fn plot(measured: &[(String, Vec<FrameFigures>)]) -> anyhow::Result<String> {
    let mut lines = Vec::new();
    for (name, figures) in measured {
        let line = |value: &dyn Fn(&FrameFigures) -> f64| -> Vec<(f64, f64)> {
            (1..)
                .map(f64::from)
                .zip(figures.iter().map(value))
                .collect()
        };
        for way in [MERGE, AUTO] {
            let name = format!("{name}: {}, ms", WAYS[way].0);
            lines.push((name, line(&|f| f.ways[way].update_ms)));
        }
        let name = format!("{name}: rays, %");
        lines.push((name, line(&|f| 100.0 * f.ways[MERGE].trace)));
    }
    let plot = LinePlot {
        x_axis: "row: from outside to all over it",
        y_axis: "update in ms; rays through the merged tree, % of best",
        scale: Axis::Logarithmic,
        lines,
    };
    plot.to_svg()
}
