//! The command `kd compare`.

use std::time::Instant;

use anyhow::bail;
use clap::Args;
use comfy_table::{CellAlignment, LineStyle, Table, TableStyle};
use kd::{KdTree, Strategy};
use kd_render::{RenderOptions, Stage, render};

use crate::print::print_line;
use crate::scene::{Builder, SceneArgs, Size};

/// Arguments of `kd compare`.
#[derive(Args, Debug)]
pub(crate) struct CompareArgs {
    #[command(flatten)]
    scene: SceneArgs,

    /// Builders to compare, separated by commas
    #[arg(
        long,
        value_enum,
        value_delimiter = ',',
        default_value = "best,balanced,fast"
    )]
    builders: Vec<Builder>,

    /// Size in pixels of the picture that is rendered with each
    #[arg(long, value_name = "WxH", default_value = "400x300")]
    size: Size,
}

pub(crate) fn run(arguments: &CompareArgs) -> anyhow::Result<()> {
    let scene = arguments.scene.load()?;
    let time = arguments.scene.time(&scene)?;
    let mesh = std::sync::Arc::new(scene.mesh_at(time)?);
    let options = RenderOptions {
        width: arguments.size.width,
        height: arguments.size.height,
        ..RenderOptions::default()
    };
    let mut table = Table::new();
    let style = TableStyle::new().header_separator(LineStyle::none().fill('─').junction('─'));
    table.load_style(style);
    table.set_header([
        "builder",
        "build ms",
        "nodes",
        "references",
        "SAH cost 15:20",
        "MB traced",
        "picture ms",
        "Mray/s",
    ]);
    let mut first = None;
    for builder in &arguments.builders {
        let start = Instant::now();
        let tree = KdTree::build(std::sync::Arc::clone(&mesh), &builder.options())?;
        let build = start.elapsed();
        let stats = tree.stats();
        let strategy = Strategy::Rebuild(builder.options());
        let mut stage = Stage::new(scene.clone(), builder.options(), strategy)?;
        stage.show(time)?;
        let start = Instant::now();
        let rendering = render(&stage, &stage.tracer(), &stage.camera(), &options, &|_| {});
        let tracing = start.elapsed();
        table.add_row([
            builder.name().to_owned(),
            format!("{:.1}", build.as_secs_f64() * 1e3),
            stats.nodes.to_string(),
            stats.references.to_string(),
            format!("{:.3}", stats.sah_cost_15_20),
            format!(
                "{:.2}",
                stats
                    .layout_bytes
                    .map_or(0, |bytes| bytes.nodes + bytes.blocks) as f64
                    * 1e-6
            ),
            format!("{:.1}", tracing.as_secs_f64() * 1e3),
            format!(
                "{:.2}",
                rendering.rays.total() as f64 / tracing.as_secs_f64() * 1e-6
            ),
        ]);
        match &first {
            None => first = Some(rendering),
            Some(first) if *first == rendering => {}
            Some(_) => bail!(
                "builders `{}` and `{}` give different pictures; this is a fault of kd",
                builder.name(),
                arguments.builders[0].name()
            ),
        }
    }
    for column in table.column_iter_mut().skip(1) {
        column.set_cell_alignment(CellAlignment::Right);
    }
    print_line(format_args!(
        "{table}\none measurement per row; all pictures are identical"
    ))?;
    Ok(())
}
