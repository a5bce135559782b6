//! The lights of a glTF file (`KHR_lights_punctual`).

use std::f32::consts::{FRAC_PI_2, FRAC_PI_4};

use glam::Vec3;
use kd_core::Aabb;

use super::Reader;
use super::json::{self, Node, Whole};
use crate::report::WarningCode;
use crate::{Light, LightKind, LoadError, SceneDescription};

impl Reader<'_> {
    /// Adds the light of a node, which is `number` in the scene.
    pub(super) fn light(
        &mut self,
        node: &Node,
        number: usize,
        pointer: &str,
    ) -> Result<(), LoadError> {
        const LIGHTS: &str = "/extensions/KHR_lights_punctual/lights";
        let of_node = node.extensions.get("KHR_lights_punctual");
        let Some(index) = of_node.and_then(|of_node| of_node.get("light")) else {
            return Ok(());
        };
        let pointer = format!("{pointer}/extensions/KHR_lights_punctual/light");
        let index: Whole = self.document.read(index, &pointer)?;
        let light: json::Light = self.document.get(LIGHTS, index)?;
        let kind = match light.r#type.as_str() {
            "point" => LightKind::Point,
            "directional" => LightKind::Directional,
            "spot" => {
                let spot = light.spot.unwrap_or_default();
                let outer = spot.outer_cone_angle.unwrap_or(FRAC_PI_4);
                let outer = outer.clamp(0.0, FRAC_PI_2);
                LightKind::Spot {
                    inner: spot.inner_cone_angle.clamp(0.0, outer),
                    outer,
                }
            }
            other => {
                let what = format!("a light has the unknown type `{other}`; it is left out");
                let pointer = format!("{LIGHTS}/{}", index.0);
                self.warn(&pointer, WarningCode::BadMaterial, what);
                return Ok(());
            }
        };
        // Far beyond any light, and finite when all are summed.
        const BRIGHTEST: f32 = 1e15;
        let color = Vec3::from(light.color.unwrap_or([1.0; 3]));
        let color = color.clamp(Vec3::ZERO, Vec3::splat(BRIGHTEST));
        let intensity = light.intensity.unwrap_or(1.0).clamp(0.0, BRIGHTEST);
        self.scene.lights.push(Light {
            kind,
            node: Some(number),
            ..Light::point(Vec3::ZERO, color * intensity)
        });
        Ok(())
    }
}

/// Scales the colors of the lights, in candela and lux, to what a renderer without distance falloff and exposure shows: as bright
/// as they are in the middle of the scene, and 1 in the largest channel of their sum.
pub(super) fn expose(scene: &mut SceneDescription) {
    let start = scene.span.map_or(0.0, |span| span.start);
    let placed = scene.placed_nodes(start);
    let mut bounds = Aabb::EMPTY;
    for part in &scene.parts {
        let of_part = part.mesh.bounds();
        if of_part.is_empty() {
            continue;
        }
        for place in part.places(&placed) {
            let corner = |i: u32| {
                let is_max = Vec3::from([i & 1, i >> 1 & 1, i >> 2].map(|bit| bit as f32));
                let corner = of_part.min + is_max * of_part.extent();
                place.transform.transform_point3(corner)
            };
            bounds = bounds.union(&Aabb::around((0..8).map(corner)));
        }
    }
    let middle = bounds.center().as_dvec3();
    let of_nearest = (0.1 * f64::from(bounds.diagonal())).powi(2);
    for light in &mut scene.lights {
        let at = light.placed(start, &placed).0.as_dvec3();
        let square = at.distance_squared(middle).max(of_nearest);
        if light.kind != LightKind::Directional && square > 0.0 && square.is_finite() {
            light.color = (light.color.as_dvec3() / square).as_vec3();
        }
    }
    let sum: Vec3 = scene.lights.iter().map(|light| light.color).sum();
    let brightest = sum.max_element();
    if brightest > 0.0 && brightest.is_finite() {
        for light in &mut scene.lights {
            light.color /= brightest;
        }
    }
}
