//! Holes in surfaces, and surfaces that blend with what is behind them.
//!
//! Rays ask for the hits that a filter accepts. Holes are rejected. Of a blended surface, the filter notes what it covers.

use kd::{Ray, Verdict};
use kd_scene::AlphaMode;

use crate::render::RenderContext;
use crate::spot::Spot;
use crate::tracer::{PartHit, Tracer};

/// What is behind surfaces of which less than this is seen through counts as covered.
const LEAST_SHARE: f32 = 1.0 / 512.0;

/// A blended surface that a ray sees in front of others.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Veil {
    /// Index of the ray.
    pub(crate) ray: usize,
    pub(crate) hit: PartHit,
    /// The share of the ray's color that comes from this surface.
    pub(crate) share: f32,
}

/// The surfaces that rays see.
#[derive(Debug)]
pub(crate) struct Seen {
    /// The hit at which each ray ends.
    pub(crate) hits: Vec<Option<PartHit>>,
    /// The share of each ray's color that comes from there; empty if all of it does.
    shares: Vec<f32>,
    /// What is in front of these hits, from front to back for each ray.
    pub(crate) veils: Vec<Veil>,
}

impl Seen {
    /// What the rays see, with the share of each surface by the operator *over* (T. Porter, T. Duff, *Compositing Digital Images*,
    /// 1984).
    pub(crate) fn by(context: &RenderContext<'_, impl Tracer>, rays: &[Ray]) -> Self {
        let mut seen = Self {
            hits: vec![None; rays.len()],
            shares: Vec::new(),
            veils: Vec::new(),
        };
        let tracer = context.tracer;
        if !context.stage.has_alpha() {
            tracer.intersect(rays, &mut seen.hits);
            return seen;
        }
        seen.shares.resize(rays.len(), 1.0);
        let (shares, veils) = (&mut seen.shares, &mut seen.veils);
        tracer.intersect_filtered(rays, &mut seen.hits, &mut |ray, hit| {
            let opacity = opacity(context, hit);
            if opacity == 0.0 {
                return Verdict::Reject;
            }
            let share = shares[ray];
            let behind = share * (1.0 - opacity);
            if behind < LEAST_SHARE {
                return Verdict::Accept;
            }
            veils.push(Veil {
                ray,
                hit: *hit,
                share: share * opacity,
            });
            shares[ray] = behind;
            Verdict::Reject
        });
        seen
    }

    /// The share of a ray's color that comes from where it ends.
    #[inline]
    pub(crate) fn share(&self, ray: usize) -> f32 {
        self.shares.get(ray).copied().unwrap_or(1.0)
    }
}

/// The hit at which each ray ends. A ray ends at a blended surface with a probability equal to its opacity; `random` gives the
/// next number of a ray, from 0 to 1.
pub(crate) fn hits_at_random(
    context: &RenderContext<'_, impl Tracer>,
    rays: &[Ray],
    mut random: impl FnMut(usize) -> f32,
) -> Vec<Option<PartHit>> {
    let mut hits = vec![None; rays.len()];
    let tracer = context.tracer;
    if !context.stage.has_alpha() {
        tracer.intersect(rays, &mut hits);
        return hits;
    }
    tracer.intersect_filtered(rays, &mut hits, &mut |ray, hit| {
        let opacity = opacity(context, hit);
        let is_hit = opacity >= 1.0 || (opacity > 0.0 && random(ray) < opacity);
        if is_hit {
            Verdict::Accept
        } else {
            Verdict::Reject
        }
    });
    hits
}

/// The share of light that arrives at the end of each ray: 0 behind an opaque surface, the product of what blended surfaces let
/// through.
pub(crate) fn light_through(context: &RenderContext<'_, impl Tracer>, rays: &[Ray]) -> Vec<f32> {
    let mut shares = vec![1.0; rays.len()];
    let mut occluded = vec![false; rays.len()];
    let tracer = context.tracer;
    if context.stage.has_alpha() {
        tracer.occluded_filtered(rays, &mut occluded, &mut |ray, hit| {
            shares[ray] *= 1.0 - opacity(context, hit);
            if shares[ray] < LEAST_SHARE {
                Verdict::Accept
            } else {
                Verdict::Reject
            }
        });
    } else {
        tracer.occluded(rays, &mut occluded);
    }
    for (share, occluded) in shares.iter_mut().zip(occluded) {
        if occluded {
            *share = 0.0;
        }
    }
    shares
}

/// The share of what is behind a hit that the surface covers there, from 0 to 1.
fn opacity<T>(context: &RenderContext<'_, T>, hit: &PartHit) -> f32 {
    let spot = Spot::new(context.stage, hit);
    match spot.material.alpha_mode {
        AlphaMode::Opaque => 1.0,
        mode => mode.opacity(spot.alpha(context.stage, context.options.textures)),
    }
}
