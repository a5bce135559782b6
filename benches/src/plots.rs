//! Plots of a run, as SVG for a page. Black becomes the page's text color there.

use std::ops::Range;

use anyhow::anyhow;
use plotters::coord::Shift;
use plotters::coord::combinators::WithKeyPoints;
use plotters::coord::ranged1d::{AsRangedCoord, ValueFormatter};
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

/// Colors of the variants, in their order; distinct for any kind of color vision (Okabe and Ito), and on light and dark
/// ground.
const PALETTE: [RGBColor; 7] = [
    RGBColor(0xe6, 0x9f, 0x00),
    RGBColor(0x38, 0x8b, 0xd6),
    RGBColor(0x00, 0x9e, 0x73),
    RGBColor(0xcc, 0x79, 0xa7),
    RGBColor(0xd5, 0x5e, 0x00),
    RGBColor(0x56, 0xc4, 0xe9),
    RGBColor(0x8a, 0x8a, 0x8a),
];

pub(crate) fn color(variant: usize) -> RGBColor {
    PALETTE[variant % PALETTE.len()]
}

const WIDTH: u32 = 1100;
const HEIGHT: u32 = 300;
const FONT: (&str, u32) = ("sans-serif", 13);
/// Room for names at the right.
const LEGEND: u32 = 150;

/// The scale of an axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Axis {
    Linear,
    Logarithmic,
}

/// Bars in groups.
#[derive(Debug)]
pub(crate) struct BarPlot<'a> {
    /// The quantity of the axis, with its unit.
    pub(crate) axis: &'a str,
    pub(crate) scale: Axis,
    pub(crate) groups: Vec<&'a str>,
    /// Names of bars and of their parts, if there is a legend.
    pub(crate) legend: Vec<[&'a str; 2]>,
    /// For each group and bar, its parts from below, which are stacked. NaN leaves a gap.
    pub(crate) values: Vec<Vec<Vec<f64>>>,
}

/// Lines and points.
#[derive(Debug)]
pub(crate) struct XyPlot<'a> {
    pub(crate) x_axis: &'a str,
    pub(crate) y_axis: &'a str,
    /// Of both axes.
    pub(crate) scale: Axis,
    /// Name and points of each line.
    pub(crate) lines: Vec<(String, Vec<(f64, f64)>)>,
    /// Variant, x, y and a name.
    pub(crate) points: Vec<(usize, f64, f64, &'a str)>,
}

type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;

/// An SVG of a drawing.
fn svg(
    size: (u32, u32),
    draw: impl FnOnce(&Area<'_>) -> anyhow::Result<()>,
) -> anyhow::Result<String> {
    let mut svg = String::new();
    let area = SVGBackend::with_string(&mut svg, size).into_drawing_area();
    draw(&area)?;
    area.present().map_err(failed)?;
    drop(area);
    Ok(svg)
}

/// A name at the right, in a row from above.
fn legend(area: &Area<'_>, row: usize, name: &str, color: RGBAColor) -> anyhow::Result<()> {
    let style = FONT.into_text_style(area).color(&color);
    let place = (
        (WIDTH - LEGEND + 10).cast_signed(),
        16 + 18 * i32::try_from(row)?,
    );
    area.draw(&Text::new(name, place, style)).map_err(failed)
}

impl XyPlot<'_> {
    /// As SVG; empty without points. Names of lines are at the right, in their colors.
    pub(crate) fn to_svg(&self) -> anyhow::Result<String> {
        let of_lines = self
            .lines
            .iter()
            .flat_map(|(_, points)| points.iter().copied());
        let alone = self.points.iter().map(|point| (point.1, point.2));
        let points: Vec<(f64, f64)> = of_lines.chain(alone).collect();
        let (xs, ys) = (
            points.iter().map(|point| point.0),
            points.iter().map(|point| point.1),
        );
        match self.scale {
            Axis::Logarithmic => match (decades(xs), decades(ys)) {
                (Some(xs), Some(ys)) => self.draw(logarithmic(xs), logarithmic(ys)),
                _ => Ok(String::new()),
            },
            Axis::Linear => match (extent(xs), extent(ys)) {
                (Some(xs), Some(ys)) => self.draw(xs, ys),
                _ => Ok(String::new()),
            },
        }
    }

    fn draw<X, Y>(&self, xs: X, ys: Y) -> anyhow::Result<String>
    where
        X: AsRangedCoord<Value = f64>,
        X::CoordDescType: ValueFormatter<f64>,
        Y: AsRangedCoord<Value = f64>,
        Y::CoordDescType: ValueFormatter<f64>,
    {
        // Points without lines fill half of the page.
        let (size, room) = if self.lines.is_empty() {
            ((WIDTH / 2, HEIGHT * 4 / 3), 8)
        } else {
            ((WIDTH, HEIGHT * 3 / 2), LEGEND)
        };
        svg(size, |area| {
            let mut chart = ChartBuilder::on(area)
                .margin(8)
                .margin_right(room)
                .set_label_area_size(LabelAreaPosition::Left, 64)
                .set_label_area_size(LabelAreaPosition::Bottom, 44)
                .build_cartesian_2d(xs, ys)
                .map_err(failed)?;
            chart
                .configure_mesh()
                .bold_line_style(BLACK.mix(0.15))
                .x_desc(self.x_axis)
                .y_desc(self.y_axis)
                .x_label_formatter(&|value| short(*value))
                .y_label_formatter(&|value| short(*value))
                .label_style(FONT)
                .draw()
                .map_err(failed)?;
            for (index, (name, points)) in self.lines.iter().enumerate() {
                let line = LineSeries::new(points.iter().copied(), color(index).stroke_width(2));
                chart.draw_series(line.point_size(3)).map_err(failed)?;
                legend(area, index, name, color(index).into())?;
            }
            let style = ("sans-serif", 11).into_text_style(area);
            let points = self.points.iter().map(|(variant, x, y, name)| {
                EmptyElement::at((*x, *y))
                    + Circle::new((0, 0), 4, color(*variant).filled())
                    + Text::new((*name).to_owned(), (6, -5), style.clone())
            });
            chart.draw_series(points).map_err(failed)?;
            Ok(())
        })
    }
}

impl BarPlot<'_> {
    /// As SVG; empty without values. Upper parts are paler.
    pub(crate) fn to_svg(&self) -> anyhow::Result<String> {
        let totals = self.values.iter().flatten().map(|parts| parts.iter().sum());
        let totals: Vec<f64> = totals.collect();
        let range = match self.scale {
            Axis::Logarithmic => decades(totals.iter().copied()),
            Axis::Linear => extent(totals.iter().copied()),
        };
        match (self.scale, range) {
            (_, None) => Ok(String::new()),
            (Axis::Logarithmic, Some(range)) => self.draw(range.start, logarithmic(range)),
            (Axis::Linear, Some(range)) => self.draw(range.start, range),
        }
    }

    fn draw<Y>(&self, bottom: f64, ys: Y) -> anyhow::Result<String>
    where
        Y: AsRangedCoord<Value = f64>,
        Y::CoordDescType: ValueFormatter<f64>,
    {
        let shade = |bar: usize, part: usize| color(bar).mix(if part == 0 { 1.0 } else { 0.45 });
        svg((WIDTH, HEIGHT), |area| {
            let room = if self.legend.is_empty() { 8 } else { LEGEND };
            let mut chart = ChartBuilder::on(area)
                .margin(8)
                .margin_right(room)
                .set_label_area_size(LabelAreaPosition::Left, 64)
                .set_label_area_size(LabelAreaPosition::Bottom, 24)
                .build_cartesian_2d(0.0..self.groups.len() as f64, ys)
                .map_err(failed)?;
            chart
                .configure_mesh()
                .disable_x_axis()
                .disable_x_mesh()
                .bold_line_style(BLACK.mix(0.15))
                .y_desc(self.axis)
                .y_label_formatter(&|value| short(*value))
                .label_style(FONT)
                .draw()
                .map_err(failed)?;
            let bars = self.values.iter().map(Vec::len).max().unwrap_or(0);
            let width = 0.8 / bars.max(1) as f64;
            let mut rectangles = Vec::new();
            for (group, bars) in self.values.iter().enumerate() {
                for (bar, parts) in bars.iter().enumerate() {
                    let start = group as f64 + 0.1 + bar as f64 * width;
                    let mut low = bottom;
                    for (part, value) in parts.iter().enumerate().filter(|(_, v)| v.is_finite()) {
                        let high = if part == 0 { *value } else { low + value };
                        let corners = [(start, low), (start + 0.92 * width, high)];
                        rectangles.push(Rectangle::new(corners, shade(bar, part).filled()));
                        low = high;
                    }
                }
            }
            chart.draw_series(rectangles).map_err(failed)?;
            let centered = Pos::new(HPos::Center, VPos::Top);
            let centered = FONT.into_text_style(area).pos(centered);
            let names = self.groups.iter().enumerate().map(|(group, name)| {
                let place = (group as f64 + 0.5, bottom);
                EmptyElement::at(place) + Text::new((*name).to_owned(), (0, 6), centered.clone())
            });
            chart.draw_series(names).map_err(failed)?;
            for (bar, parts) in self.legend.iter().enumerate() {
                for (part, name) in parts.iter().enumerate() {
                    legend(area, 2 * bar + part, name, shade(bar, part))?;
                }
            }
            Ok(())
        })
    }
}

/// A range of all values and 0, for a linear axis; `None` without values.
fn extent(values: impl Iterator<Item = f64>) -> Option<Range<f64>> {
    let (low, high) = bounds(values)?;
    let (low, high) = (low.min(0.0), high.max(0.0));
    Some(low..high + 0.05 * (high - low).max(1e-9))
}

/// A range of all positive values with a margin, for a logarithmic axis; `None` without positive values.
fn decades(values: impl Iterator<Item = f64>) -> Option<Range<f64>> {
    let (low, high) = bounds(values.filter(|value| *value > 0.0))?;
    Some(low * 0.6..high * 1.4)
}

fn bounds(values: impl Iterator<Item = f64>) -> Option<(f64, f64)> {
    values
        .filter(|value| value.is_finite())
        .fold(None, |bounds, value| {
            let (low, high) = bounds.unwrap_or((value, value));
            Some((low.min(value), high.max(value)))
        })
}

/// A logarithmic axis with lines at 1, 2 and 5 times each power of ten.
fn logarithmic(range: Range<f64>) -> WithKeyPoints<LogCoord<f64>> {
    let lines = lines(&range);
    range.log_scale().with_key_points(lines)
}

fn lines(range: &Range<f64>) -> Vec<f64> {
    let powers = (-6..=12).map(|exponent| 10.0_f64.powi(exponent));
    powers
        .flat_map(|power| [power, 2.0 * power, 5.0 * power])
        .filter(|line| range.contains(line))
        .collect()
}

/// A number on an axis, without the error of powers below 1.
fn short(value: f64) -> String {
    ((value * 1e6).round() / 1e6).to_string()
}

/// Errors of the drawing library borrow the drawing.
fn failed<E: std::error::Error + Send + Sync>(why: DrawingAreaErrorKind<E>) -> anyhow::Error {
    anyhow!("cannot draw a plot: {why}")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn bars<'a>(scale: Axis, groups: Vec<&'a str>, values: Vec<Vec<Vec<f64>>>) -> BarPlot<'a> {
        BarPlot {
            axis: "ns",
            scale,
            groups,
            legend: vec![],
            values,
        }
    }

    fn count(svg: &str, variant: usize) -> usize {
        let RGBColor(r, g, b) = color(variant);
        svg.matches(&format!("fill=\"#{r:02X}{g:02X}{b:02X}\""))
            .count()
    }

    #[test]
    fn bars_leave_gaps_for_missing_values_and_stack() {
        let values = vec![vec![vec![1.0], vec![2.0]], vec![vec![f64::NAN], vec![3.0]]];
        let plot = bars(Axis::Logarithmic, vec!["a", "b"], values);
        let svg = plot.to_svg().expect("drawn");
        assert_eq!(
            (count(&svg, 0), count(&svg, 1)),
            (1, 2),
            "three bars: {svg}"
        );
        let stacked = bars(Axis::Linear, vec!["a"], vec![vec![vec![1.0, 2.0]]]);
        let svg = stacked.to_svg().expect("drawn");
        assert_eq!(count(&svg, 0), 2, "two parts: {svg}");
    }

    #[test]
    fn axes_have_lines_between_powers_of_ten() {
        assert_eq!(
            lines(&(0.15..60.0)),
            [0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0],
            "1, 2, 5"
        );
    }

    #[test]
    fn without_values_there_is_no_plot() {
        let bars = bars(Axis::Logarithmic, vec!["a"], vec![vec![vec![f64::NAN]]]);
        assert_eq!(bars.to_svg().expect("no error"), "", "no value");
        let points = XyPlot {
            x_axis: "x",
            y_axis: "y",
            scale: Axis::Logarithmic,
            lines: vec![],
            points: vec![(0, 0.0, 1.0, "a")],
        };
        assert_eq!(points.to_svg().expect("no error"), "", "0 has no logarithm");
    }
}
