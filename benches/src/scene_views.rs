//! `scenes.toml` in a folder of meshes: the camera and the light of each.
//!
//! ```toml
//! [sponza]                  # the mesh file's name without its extension
//! eye = [-10, 2, 0]         # needs target
//! target = [10, 5, 0.5]
//! up = [0, 1, 0]            # default
//! fov = 45                  # degrees, default
//! light = [0, 11, 0]        # default: above the camera
//! ```

use std::collections::BTreeMap;

use anyhow::{Context as _, bail};
use kd::Aabb;
use kd::glam::Vec3;
use kd_scene::Camera;
use serde::Deserialize;

/// One entry. Every field is optional.
#[derive(Clone, Copy, Debug, Default, Deserialize, PartialEq)]
#[serde(deny_unknown_fields)]
pub(crate) struct SceneView {
    eye: Option<[f32; 3]>,
    target: Option<[f32; 3]>,
    up: Option<[f32; 3]>,
    fov: Option<f32>,
    light: Option<[f32; 3]>,
}

/// Entries by mesh name.
pub(crate) fn parse(text: &str) -> anyhow::Result<BTreeMap<String, SceneView>> {
    let views: BTreeMap<String, SceneView> = toml::from_str(text)?;
    for (name, view) in &views {
        view.check().with_context(|| format!("[{name}]"))?;
    }
    Ok(views)
}

impl SceneView {
    fn check(&self) -> anyhow::Result<()> {
        let Self {
            eye,
            target,
            up,
            fov,
            light,
        } = *self;
        if eye.is_some() != target.is_some() {
            bail!("eye and target go together");
        }
        if eye.is_some() && eye == target {
            bail!("eye and target must differ");
        }
        if up == Some([0.0; 3]) {
            bail!("up must not be zero");
        }
        if fov.is_some_and(|fov| !(fov > 0.0 && fov < 180.0)) {
            bail!("fov must be above 0 and below 180 degrees");
        }
        let points = [eye, target, up, light];
        if points.iter().flatten().flatten().any(|x| !x.is_finite()) {
            bail!("coordinates must be finite");
        }
        Ok(())
    }

    /// The camera and the light for a mesh with these bounds.
    pub(crate) fn resolve(&self, bounds: Aabb) -> (Camera, Vec3) {
        let up = Vec3::from(self.up.unwrap_or([0.0, 1.0, 0.0]));
        let mut camera = Camera::looking_at_whole(bounds, up);
        if let (Some(eye), Some(target)) = (self.eye, self.target) {
            camera.eye = eye.into();
            camera.target = target.into();
        }
        camera.fov_degrees = self.fov.unwrap_or(camera.fov_degrees);
        let above = camera.eye + bounds.diagonal() * up.normalize();
        (camera, self.light.map_or(above, Vec3::from))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn entries_are_read_and_completed() {
        let text = "[hall]\neye = [1, 2, 3]\ntarget = [0, 0, 0]\nfov = 65\nlight = [0, 9.5, 0]\n[city]\nup = [0, 0, 1]\n";
        let views = parse(text).expect("valid");
        let bounds = Aabb::around([Vec3::ZERO, Vec3::ONE]);
        let (hall, light) = views["hall"].resolve(bounds);
        assert_eq!(
            (hall.eye, hall.fov_degrees),
            (Vec3::new(1.0, 2.0, 3.0), 65.0),
            "as written"
        );
        assert_eq!(light, Vec3::new(0.0, 9.5, 0.0), "as written");
        let (city, light) = views["city"].resolve(bounds);
        assert_eq!(
            city,
            Camera::looking_at_whole(bounds, Vec3::Z),
            "seen from outside"
        );
        assert!(light.z > city.eye.z, "above the camera: {light}");
    }

    #[test]
    fn mistakes_are_named() {
        for (text, said) in [
            ("[hall]\neye = [1, 2, 3]\n", "eye and target go together"),
            (
                "[hall]\neye = [1, 2, 3]\ntarget = [1, 2, 3]\n",
                "must differ",
            ),
            ("[hall]\nfov = 180\n", "fov must be above 0 and below 180"),
            ("[hall]\nup = [0, 0, 0]\n", "up must not be zero"),
            ("[hall]\nlight = [nan, 0, 0]\n", "must be finite"),
            ("[hall]\nlamp = [1, 2, 3]\n", "unknown field `lamp`"),
            ("[hall]\nlight = [1, 2]\n", "invalid length 2"),
            ("hall = 3\n", "invalid type"),
        ] {
            let error = format!("{:#}", parse(text).expect_err(text));
            assert!(error.contains(said), "{text}: {error}");
            assert!(
                error.contains("hall") || error.contains("line 2"),
                "says where: {error}"
            );
        }
    }
}
