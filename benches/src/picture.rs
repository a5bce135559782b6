//! Two pictures of a scene: a shaded one, and one of the cost of its rays.

use std::io::Cursor;
use std::sync::Arc;

use image::ImageFormat;
use kd::{BuildOptions, KdTree, Strategy};
use kd_render::{Picture, RenderOptions, Stage, heat_map, render};
use kd_scene::SceneDescription;
use serde::{Deserialize, Serialize};

use crate::scenes::Scene;

/// The scale of the colors of a heat picture.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Serialize)]
pub(crate) struct HeatScale {
    /// Steps (nodes, leaves and triangles) of the brightest color; one of 200 pixels may exceed it.
    pub(crate) brightest: u64,
    pub(crate) mean: f64,
}

/// The scene from its camera, as PNG, with four rays for each pixel.
pub(crate) fn shaded(description: SceneDescription, side: u32) -> anyhow::Result<Vec<u8>> {
    let stage = Stage::new(description, BuildOptions::default(), Strategy::default())?;
    let options = RenderOptions {
        width: side,
        height: side,
        subpixels: 2,
        ..RenderOptions::default()
    };
    let rendering = render(&stage, &stage.tracer(), &stage.camera(), &options, &|_| {});
    png(&rendering.picture)
}

/// The steps of the ray through each pixel in the default tree, as PNG.
pub(crate) fn heat(scene: &Scene, side: u32) -> anyhow::Result<(Vec<u8>, HeatScale)> {
    let tree = KdTree::build(Arc::clone(&scene.mesh), &BuildOptions::default())?;
    let heat = heat_map(&tree, &scene.camera, [side, side]);
    let scale = HeatScale {
        brightest: heat.brightest,
        mean: heat.mean,
    };
    Ok((png(&heat.picture)?, scale))
}

fn png(picture: &Picture) -> anyhow::Result<Vec<u8>> {
    let mut bytes = Cursor::new(Vec::new());
    picture.to_image().write_to(&mut bytes, ImageFormat::Png)?;
    Ok(bytes.into_inner())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scenes::SceneSource;

    #[test]
    fn pictures_show_the_scene() {
        let source = SceneSource::generated(kd_scene::Spd::Tetra, 2);
        let (scene, description) = source.load_described().expect("small");
        let (heat, scale) = heat(&scene, 16).expect("drawn");
        for png in [shaded(description, 16).expect("drawn"), heat] {
            let picture = image::load_from_memory(&png).expect("a PNG").to_rgb8();
            let (corner, middle) = (picture.get_pixel(0, 0), picture.get_pixel(8, 8));
            assert_ne!(corner, middle, "background and tetrahedron");
        }
        let is_scale = scale.brightest as f64 >= scale.mean && scale.mean > 0.0;
        assert!(is_scale, "{scale:?}");
    }
}
