//! Rays of a camera and of a LiDAR.

use kd::glam::Vec3;
use kd::{Aabb, Ray};
use kd_scene::{Camera, Lidar, SceneDescription, View};

use super::RaySource;
use crate::scene::Size;

/// A ray through the center of each pixel, row by row from the upper left.
pub(super) struct CameraRays {
    view: View,
    size: Size,
    next: u64,
}

impl CameraRays {
    /// The camera of the scene, or one that sees all of `bounds`.
    pub(super) fn new(
        scene: &SceneDescription,
        time: f64,
        bounds: Aabb,
        size: Option<Size>,
    ) -> Self {
        let camera = scene.camera_at(time);
        let camera = camera.unwrap_or_else(|| Camera::looking_at_whole(bounds, Vec3::Y));
        let size = size.unwrap_or_else(|| {
            let [width, height] = scene.resolution.unwrap_or([800, 600]);
            Size { width, height }
        });
        Self {
            view: camera.view(size.width as f32 / size.height as f32),
            size,
            next: 0,
        }
    }
}

impl RaySource for CameraRays {
    fn skip(&mut self, rays: u64) -> anyhow::Result<()> {
        self.next += rays;
        Ok(())
    }

    fn len(&self) -> Option<u64> {
        Some(u64::from(self.size.width) * u64::from(self.size.height))
    }

    fn read(&mut self, most: usize, to: &mut Vec<Ray>) -> anyhow::Result<()> {
        let Size { width, height } = self.size;
        let end = self.len().unwrap_or(0).min(self.next + most as u64);
        for pixel in self.next..end {
            let [row, column] = [pixel / u64::from(width), pixel % u64::from(width)];
            let [row, column] = [u32::try_from(row)?, u32::try_from(column)?];
            let direction = self.view.through_pixel(column, row, width, height);
            to.push(Ray::new(self.view.eye, direction));
        }
        self.next = end;
        Ok(())
    }
}

/// One turn of a LiDAR, step by step.
pub(super) struct LidarRays {
    lidar: Lidar,
    next: u64,
}

impl LidarRays {
    pub(super) fn new(lidar: Lidar) -> Self {
        Self { lidar, next: 0 }
    }
}

impl RaySource for LidarRays {
    fn skip(&mut self, rays: u64) -> anyhow::Result<()> {
        self.next += rays;
        Ok(())
    }

    fn len(&self) -> Option<u64> {
        Some(self.lidar.len())
    }

    fn read(&mut self, most: usize, to: &mut Vec<Ray>) -> anyhow::Result<()> {
        let channels = u64::from(self.lidar.channels);
        let end = self.lidar.len().min(self.next + most as u64);
        for number in self.next..end {
            let [step, channel] = [number / channels, number % channels];
            to.push(
                self.lidar
                    .ray(u32::try_from(step)?, u32::try_from(channel)?),
            );
        }
        self.next = end;
        Ok(())
    }
}
