//! Plots of a run, as SVG to be put into a page. Black becomes the page's text colour there.

use std::ops::Range;

use anyhow::anyhow;
use plotters::coord::combinators::WithKeyPoints;
use plotters::coord::ranged1d::{AsRangedCoord, ValueFormatter};
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

/// Colours of the variants, in their order; told apart by people with any kind of colour vision (Okabe and Ito), and on
/// light and dark ground.
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

/// Bars in groups, over a logarithmic axis.
#[derive(Debug)]
pub(crate) struct BarPlot<'a> {
    /// What the axis measures, with its unit.
    pub(crate) axis: &'a str,
    pub(crate) groups: Vec<&'a str>,
    /// For each group, the value of each variant. NaN leaves a gap.
    pub(crate) values: Vec<Vec<f64>>,
}

/// Bars in groups, each of two parts, one on the other.
#[derive(Debug)]
pub(crate) struct StackedBars {
    /// What the axis measures, with its unit.
    pub(crate) axis: &'static str,
    /// What the lower and the upper parts are.
    pub(crate) parts: [&'static str; 2],
    /// What the bars of a group are.
    pub(crate) names: [&'static str; 2],
    pub(crate) groups: Vec<String>,
    /// For each group, the parts of each bar.
    pub(crate) values: Vec<[[f64; 2]; 2]>,
}

/// Points, on logarithmic axes.
#[derive(Debug)]
pub(crate) struct ScatterPlot<'a> {
    pub(crate) x_axis: &'a str,
    pub(crate) y_axis: &'a str,
    /// Variant, x, y and a name.
    pub(crate) points: Vec<(usize, f64, f64, &'a str)>,
}

/// How an axis is divided.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Axis {
    Linear,
    Logarithmic,
}

/// Lines.
#[derive(Debug)]
pub(crate) struct LinePlot<'a> {
    pub(crate) x_axis: &'a str,
    pub(crate) y_axis: &'a str,
    /// Of both axes.
    pub(crate) scale: Axis,
    /// Name and points of each line.
    pub(crate) lines: Vec<(String, Vec<(f64, f64)>)>,
}

/// Room for the names of lines.
const LEGEND: i32 = 150;

impl LinePlot<'_> {
    /// As SVG; empty if there is no point. Names stand at the right, in the colours of their lines.
    pub(crate) fn to_svg(&self) -> anyhow::Result<String> {
        let points = || self.lines.iter().flat_map(|(_, points)| points);
        let (xs, ys) = (points().map(|point| point.0), points().map(|point| point.1));
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
        Y: AsRangedCoord<Value = f64>,
        X::CoordDescType: ValueFormatter<f64>,
        Y::CoordDescType: ValueFormatter<f64>,
    {
        let mut svg = String::new();
        let area = SVGBackend::with_string(&mut svg, (WIDTH, HEIGHT * 3 / 2)).into_drawing_area();
        let mut chart = ChartBuilder::on(&area)
            .margin(8)
            .margin_right(LEGEND)
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
            let color = color(index);
            let line = LineSeries::new(points.iter().copied(), color.stroke_width(2));
            chart.draw_series(line.point_size(3)).map_err(failed)?;
            let style = FONT.into_text_style(&area).color(&color);
            let row = i32::try_from(index)?;
            let place = (WIDTH.cast_signed() - LEGEND + 10, 16 + 18 * row);
            area.draw(&Text::new(name.as_str(), place, style))
                .map_err(failed)?;
        }
        area.present().map_err(failed)?;
        drop(chart);
        drop(area);
        Ok(svg)
    }
}

impl BarPlot<'_> {
    /// As SVG; empty if there is no value.
    pub(crate) fn to_svg(&self) -> anyhow::Result<String> {
        let Some(range) = decades(self.values.iter().flatten().copied()) else {
            return Ok(String::new());
        };
        let bottom = range.start;
        let mut svg = String::new();
        let area = SVGBackend::with_string(&mut svg, (WIDTH, HEIGHT)).into_drawing_area();
        let mut chart = ChartBuilder::on(&area)
            .margin(8)
            .set_label_area_size(LabelAreaPosition::Left, 64)
            .set_label_area_size(LabelAreaPosition::Bottom, 24)
            .build_cartesian_2d(0.0..self.groups.len() as f64, logarithmic(range))
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
        let variants = self.values.iter().map(Vec::len).max().unwrap_or(0);
        let bar = 0.8 / variants.max(1) as f64;
        for (group, values) in self.values.iter().enumerate() {
            let left = group as f64 + 0.1;
            let drawn = values
                .iter()
                .enumerate()
                .filter(|(_, value)| value.is_finite());
            let bars = drawn.map(|(variant, value)| {
                let start = left + variant as f64 * bar;
                Rectangle::new(
                    [(start, bottom), (start + 0.92 * bar, *value)],
                    color(variant).filled(),
                )
            });
            chart.draw_series(bars).map_err(failed)?;
        }
        let centered = FONT
            .into_text_style(&area)
            .pos(Pos::new(HPos::Center, VPos::Top));
        let names = self.groups.iter().enumerate().map(|(group, name)| {
            let place = (group as f64 + 0.5, bottom);
            EmptyElement::at(place) + Text::new((*name).to_owned(), (0, 6), centered.clone())
        });
        chart.draw_series(names).map_err(failed)?;
        area.present().map_err(failed)?;
        drop(chart);
        drop(area);
        Ok(svg)
    }
}

impl StackedBars {
    /// As SVG; empty if there is no group. Lower parts are darker.
    pub(crate) fn to_svg(&self) -> anyhow::Result<String> {
        let totals = self
            .values
            .iter()
            .flatten()
            .map(|[lower, upper]| lower + upper);
        let highest = totals.fold(0.0, f64::max);
        if highest <= 0.0 {
            return Ok(String::new());
        }
        let mut svg = String::new();
        let area = SVGBackend::with_string(&mut svg, (WIDTH, HEIGHT)).into_drawing_area();
        let mut chart = ChartBuilder::on(&area)
            .margin(8)
            .margin_right(LEGEND)
            .set_label_area_size(LabelAreaPosition::Left, 64)
            .set_label_area_size(LabelAreaPosition::Bottom, 24)
            .build_cartesian_2d(0.0..self.groups.len() as f64, 0.0..1.05 * highest)
            .map_err(failed)?;
        chart
            .configure_mesh()
            .disable_x_axis()
            .disable_x_mesh()
            .bold_line_style(BLACK.mix(0.15))
            .y_desc(self.axis)
            .label_style(FONT)
            .draw()
            .map_err(failed)?;
        let shade = |bar: usize, part: usize| color(bar).mix(if part == 0 { 1.0 } else { 0.45 });
        for (group, bars) in self.values.iter().enumerate() {
            for (bar, parts) in bars.iter().enumerate() {
                let start = group as f64 + 0.12 + 0.38 * bar as f64;
                let mut low = 0.0;
                let rectangles = parts.iter().enumerate().map(|(part, value)| {
                    let bottom = low;
                    low += value;
                    let corners = [(start, bottom), (start + 0.34, low)];
                    Rectangle::new(corners, shade(bar, part).filled())
                });
                chart.draw_series(rectangles).map_err(failed)?;
            }
        }
        let centered = FONT
            .into_text_style(&area)
            .pos(Pos::new(HPos::Center, VPos::Top));
        let names = self.groups.iter().enumerate().map(|(group, name)| {
            let place = (group as f64 + 0.5, 0.0);
            EmptyElement::at(place) + Text::new(name.clone(), (0, 6), centered.clone())
        });
        chart.draw_series(names).map_err(failed)?;
        for bar in 0..2 {
            for part in 0..2 {
                let row = i32::try_from(2 * bar + part)?;
                let (x, y) = (WIDTH.cast_signed() - LEGEND + 10, 16 + 18 * row);
                let square = [(x, y), (x + 12, y + 12)];
                area.draw(&Rectangle::new(square, shade(bar, part).filled()))
                    .map_err(failed)?;
                let name = format!("{}, {}", self.names[bar], self.parts[part]);
                area.draw(&Text::new(name, (x + 18, y), FONT.into_text_style(&area)))
                    .map_err(failed)?;
            }
        }
        area.present().map_err(failed)?;
        drop(chart);
        drop(area);
        Ok(svg)
    }
}

impl ScatterPlot<'_> {
    /// As SVG; empty if there is no point.
    pub(crate) fn to_svg(&self) -> anyhow::Result<String> {
        let xs = decades(self.points.iter().map(|point| point.1));
        let ys = decades(self.points.iter().map(|point| point.2));
        let (Some(xs), Some(ys)) = (xs, ys) else {
            return Ok(String::new());
        };
        let mut svg = String::new();
        let area =
            SVGBackend::with_string(&mut svg, (WIDTH / 2, HEIGHT * 4 / 3)).into_drawing_area();
        let mut chart = ChartBuilder::on(&area)
            .margin(8)
            .set_label_area_size(LabelAreaPosition::Left, 64)
            .set_label_area_size(LabelAreaPosition::Bottom, 44)
            .build_cartesian_2d(logarithmic(xs), logarithmic(ys))
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
        let name_style = ("sans-serif", 11).into_text_style(&area);
        let points = self.points.iter().map(|(variant, x, y, name)| {
            EmptyElement::at((*x, *y))
                + Circle::new((0, 0), 4, color(*variant).filled())
                + Text::new((*name).to_owned(), (6, -5), name_style.clone())
        });
        chart.draw_series(points).map_err(failed)?;
        area.present().map_err(failed)?;
        drop(chart);
        drop(area);
        Ok(svg)
    }
}

/// A range that holds all values and 0, for a linear axis; none without values.
fn extent(values: impl Iterator<Item = f64>) -> Option<Range<f64>> {
    let usable = values.filter(|value| value.is_finite());
    let bounds = usable.fold(None, |bounds: Option<(f64, f64)>, value| {
        let (low, high) = bounds.unwrap_or((0.0, 0.0));
        Some((low.min(value), high.max(value)))
    });
    bounds.map(|(low, high)| low..high + 0.05 * (high - low).max(1e-9))
}

/// A range that holds all values with some room, for a logarithmic axis; none without positive values.
fn decades(values: impl Iterator<Item = f64>) -> Option<Range<f64>> {
    let usable = values.filter(|value| value.is_finite() && *value > 0.0);
    let bounds = usable.fold(None, |bounds: Option<(f64, f64)>, value| {
        let (low, high) = bounds.unwrap_or((value, value));
        Some((low.min(value), high.max(value)))
    });
    bounds.map(|(low, high)| low * 0.6..high * 1.4)
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

    #[test]
    fn bars_leave_gaps_for_what_was_not_measured() {
        let plot = BarPlot {
            axis: "ns",
            groups: vec!["a", "b"],
            values: vec![vec![1.0, 2.0], vec![f64::NAN, 3.0]],
        };
        let svg = plot.to_svg().expect("drawn");
        let bars = |variant| {
            let RGBColor(r, g, b) = color(variant);
            svg.matches(&format!("fill=\"#{r:02X}{g:02X}{b:02X}\""))
                .count()
        };
        assert_eq!((bars(0), bars(1)), (1, 2), "three bars: {svg}");
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
    fn nothing_to_show_gives_no_plot() {
        let bars = BarPlot {
            axis: "ns",
            groups: vec!["a"],
            values: vec![vec![f64::NAN]],
        };
        assert_eq!(
            bars.to_svg().expect("no error"),
            "",
            "no axis without a value"
        );
        let points = ScatterPlot {
            x_axis: "x",
            y_axis: "y",
            points: vec![(0, 0.0, 1.0, "a")],
        };
        assert_eq!(
            points.to_svg().expect("no error"),
            "",
            "0 has no place on a logarithmic axis"
        );
    }
}
