//! Small picture of a run, with the commanded and measured positions of the six joints and, below, the tracking errors.

use std::fmt::Write;

use super::curves::Curve;
use super::{ReportInput, escape};

const WIDTH: f64 = 960.0;
const HEIGHT: f64 = 560.0;
/// Maximum number of points per curve, which is sufficient for the width in pixels.
const POINTS: usize = 260;
/// Minimum and maximum number of grid lines on an axis.
const TICKS: (usize, usize) = (3, 12);
/// Largest magnitude that is drawn. Larger values are considered invalid.
const DRAWN_MAX: f64 = 1e30;

/// Style with light colours by default. If the reader has selected a dark theme, the style uses dark colours.
const STYLE: &str = "\
svg{--paper:#fffefb;--ink:#1b1f24;--soft:#5f666f;--grid:#eceae2;--j0:#2559d6;--j1:#dd6412;--j2:#0c8a5b;--j3:#c02c7c;--j4:#7547cf;--j5:#94780a}\
@media (prefers-color-scheme:dark){svg{--paper:#161a20;--ink:#e9ebee;--soft:#9aa3af;--grid:#262c35;--j0:#7aa5ff;--j1:#ff9d57;--j2:#43d39e;--j3:#ff77b6;--j4:#b79bff;--j5:#e3c84c}}\
text{font-family:system-ui,-apple-system,'Segoe UI','Noto Sans',sans-serif;font-size:12px;fill:var(--soft)}\
.t{font-size:19px;font-weight:600;fill:var(--ink);letter-spacing:-.3px}.n{font-weight:600;fill:var(--ink)}\
.g{stroke:var(--grid);stroke-width:1}.c{fill:none;stroke-width:6;stroke-linejoin:round;opacity:.25}\
.m{fill:none;stroke-width:1.5;stroke-linejoin:round}.e{fill:none;stroke-width:1.1;stroke-linejoin:round}";

/// Plot area of the picture with its axes.
struct Panel {
    left: f64,
    top: f64,
    width: f64,
    height: f64,
    /// First and last time, s. The last time must be greater than the first time.
    time: (f64, f64),
    /// Lowest and highest value. The highest value must be greater than the lowest value.
    value: (f64, f64),
}

impl Panel {
    fn x(&self, t: f64) -> f64 {
        self.left + (t - self.time.0) / (self.time.1 - self.time.0) * self.width
    }

    fn y(&self, v: f64) -> f64 {
        self.top + (self.value.1 - v) / (self.value.1 - self.value.0) * self.height
    }

    fn path(&self, points: &[(f64, f64)]) -> String {
        let mut path = String::new();
        let mut pen_down = false;
        for &(t, v) in points {
            if is_drawn(v) {
                let _ = write!(path, "{}{:.1} {:.1}", if pen_down { 'L' } else { 'M' }, self.x(t), self.y(v));
            }
            pen_down = is_drawn(v);
        }
        path
    }

    /// Draws the grid lines of the values, with their labels.
    fn grid(&self, svg: &mut String) {
        let (l, r) = (self.left, self.left + self.width);
        for (v, label) in ticks(self.value.0, self.value.1, 1.0) {
            let y = self.y(v);
            let _ = writeln!(svg, r#"<path class="g" d="M{l:.1} {y:.1}H{r:.1}"/>"#);
            let _ = writeln!(
                svg,
                r#"<text x="{:.1}" y="{:.1}" text-anchor="end">{label}</text>"#,
                l - 7.0,
                y + 4.0
            );
        }
    }
}

/// Returns the picture as SVG. The picture adapts to the light or dark theme of the reader.
pub fn picture_svg(input: &ReportInput<'_>) -> String {
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {WIDTH} {HEIGHT}\" role=\"img\">\n<style>{STYLE}</style>\n\
         <rect width=\"{WIDTH}\" height=\"{HEIGHT}\" rx=\"14\" fill=\"var(--paper)\"/>\n"
    );
    if let Some((first_s, last_s)) = input.digest.span_s() {
        let time = (first_s, last_s.max(first_s + 1e-3 + margin(first_s)));
        heading(&mut svg, input);
        for j in 0..6 {
            positions(&mut svg, input, j, time);
        }
        errors(&mut svg, input, time);
    }
    svg.push_str("</svg>\n");
    svg
}

fn heading(svg: &mut String, input: &ReportInput<'_>) {
    let summary = input.digest.summary(input.info);
    if let Some(failure) = input.failure {
        let text = escape(&failure.headline());
        let _ = writeln!(svg, r#"<text class="t" style="fill:#c5372c" x="32" y="42">{text}</text>"#);
        return;
    }
    let _ = writeln!(svg, r#"<text class="t" x="32" y="42">Six joints on their trajectory</text>"#);
    let worst = |figure: fn(&super::JointSummary) -> Option<f64>| summary.worst(figure).map(|(_, v)| v);
    let mut text = format!("{:.1} s at 1 kHz", summary.recorded_s);
    if let Some(rms) = worst(|j| j.rms_error_mrad) {
        let _ = write!(text, " · tracking error at most {rms:.2} mrad RMS");
    }
    if let Some(max) = worst(|j| j.max_error_mrad) {
        let _ = write!(text, ", {max:.2} mrad peak");
    }
    let _ = writeln!(svg, r#"<text x="32" y="62">{text}</text>"#);
    let _ = writeln!(
        svg,
        r#"<path class="c" style="stroke:var(--j0)" d="M698 37h26"/><text x="732" y="41">commanded</text><path class="m" style="stroke:var(--j0)" d="M818 37h26"/><text x="852" y="41">measured</text>"#
    );
}

fn positions(svg: &mut String, input: &ReportInput<'_>, j: usize, time: (f64, f64)) {
    let measured = thinned(&points(input, Curve::Position, j));
    let set = thinned(&points(input, Curve::SetPosition, j));
    let value = position_axis(bounds(measured.iter().chain(&set)).unwrap_or((-1.0, 1.0)));
    let (column, row) = ((j % 3) as f64, (j / 3) as f64);
    let panel = Panel {
        left: 64.0 + column * 300.0,
        top: 102.0 + row * 152.0,
        width: 236.0,
        height: 106.0,
        time,
        value,
    };
    let _ = writeln!(
        svg,
        r#"<text class="n" x="{:.1}" y="{:.1}">Joint {}</text>"#,
        panel.left,
        panel.top - 8.0,
        j + 1
    );
    panel.grid(svg);
    let _ = writeln!(svg, r#"<path class="c" style="stroke:var(--j{j})" d="{}"/>"#, panel.path(&set));
    let _ = writeln!(svg, r#"<path class="m" style="stroke:var(--j{j})" d="{}"/>"#, panel.path(&measured));
}

fn errors(svg: &mut String, input: &ReportInput<'_>, time: (f64, f64)) {
    let lines: Vec<Vec<(f64, f64)>> = (0..6).map(|j| extremes(&points(input, Curve::Error, j))).collect();
    let Some((low, high)) = bounds(lines.iter().flatten()) else { return };
    let reach = low.abs().max(high.abs()).max(0.1) * 1.1;
    let panel = Panel { left: 64.0, top: 418.0, width: 836.0, height: 88.0, time, value: (-reach, reach) };
    let _ = writeln!(svg, r#"<text class="n" x="64" y="406">Tracking error, mrad</text>"#);
    let _ = writeln!(svg, r#"<text x="900" y="406" text-anchor="end">positions in rad</text>"#);
    panel.grid(svg);
    for (j, line) in lines.iter().enumerate() {
        let _ = writeln!(svg, r#"<path class="e" style="stroke:var(--j{j})" d="{}"/>"#, panel.path(line));
    }
    for (t, text) in ticks(0.0, time.1 - time.0, 0.6) {
        let x = panel.x(time.0 + t);
        let _ = writeln!(svg, r#"<text x="{x:.1}" y="530" text-anchor="middle">{text} s</text>"#);
    }
}

/// Returns the times and values of a curve.
fn points(input: &ReportInput<'_>, curve: Curve, j: usize) -> Vec<(f64, f64)> {
    let curves = &input.digest.curves;
    curves.times().into_iter().zip(curves.values(curve, j)).collect()
}

fn thinned(points: &[(f64, f64)]) -> Vec<(f64, f64)> {
    let step = points.len().div_ceil(POINTS).max(1);
    let mut thinned: Vec<_> = points.iter().copied().step_by(step).collect();
    thinned.extend(points.last());
    thinned
}

/// Returns the lowest and the highest point of each bucket, so that a peak of a single sample stays visible.
fn extremes(points: &[(f64, f64)]) -> Vec<(f64, f64)> {
    let bucket = points.len().div_ceil(2 * POINTS).max(1);
    let pair = |bucket: &[(f64, f64)]| {
        let values = bucket.iter().map(|point| point.1).filter(|v| is_drawn(*v));
        let low = values.clone().reduce(f64::min).unwrap_or(f64::NAN);
        let high = values.reduce(f64::max).unwrap_or(f64::NAN);
        [(bucket[0].0, low), (bucket[bucket.len() / 2].0, high)]
    };
    points.chunks(bucket).flat_map(pair).collect()
}

fn bounds<'a>(points: impl Iterator<Item = &'a (f64, f64)>) -> Option<(f64, f64)> {
    points.filter(|p| is_drawn(p.1)).fold(None, |b, &(_, v)| {
        let (low, high) = b.unwrap_or((v, v));
        Some((low.min(v), high.max(v)))
    })
}

/// Returns `true` if the number is in the range that can be drawn.
fn is_drawn(v: f64) -> bool {
    v.abs() < DRAWN_MAX
}

/// Returns the smallest span of an axis around `v` at which neighbouring labels still differ.
fn margin(v: f64) -> f64 {
    1e-9 * v.abs()
}

/// Returns the axis for positions from `low` to `high`. The range of the axis includes a margin, even if the joint does not move.
fn position_axis((low, high): (f64, f64)) -> (f64, f64) {
    let margin = ((high - low) * 0.08).max(0.02).max(margin(low)).max(margin(high));
    (low - margin, high + margin)
}

/// Returns the values and labels of the grid lines between `low` and `high`. [`TICKS`] limits their number. The
/// distance between grid lines is about `share` / 4 of the axis, so a smaller `share` gives more grid lines.
fn ticks(low: f64, high: f64, share: f64) -> Vec<(f64, String)> {
    let rough = share * (high - low) / 4.0;
    if !(rough.is_finite() && rough > 0.0) {
        return Vec::new();
    }
    // The distance between grid lines is 1, 2 or 5 times a power of ten. The function uses the smallest such distance
    // that is not below `rough`, or a smaller one if there would be too few grid lines.
    let power = 10f64.powf(rough.log10().floor());
    let steps = [10.0, 5.0, 2.0, 1.0, 0.5, 0.2].map(|m| m * power);
    let enough = steps.iter().rposition(|step| *step >= rough).unwrap_or(0);
    let lines = |step: &f64| ((low / step).ceil(), (high / step).floor());
    let fits = |step: &&f64| lines(step).1 - lines(step).0 + 1.0 >= TICKS.0 as f64;
    let Some(step) = steps[enough..].iter().find(fits) else { return Vec::new() };
    let (first, last) = lines(step);
    let digits = Digits::of(*step, low.abs().max(high.abs()));
    let tick = |i: f64| (i * step, label(i * step, digits));
    (0..TICKS.1).map(|k| first + k as f64).take_while(|i| *i <= last).map(tick).collect()
}

/// Number format.
#[derive(Clone, Copy)]
enum Digits {
    /// Format with this number of digits after the decimal point.
    Plain(usize),
    /// Format with this number of digits after the decimal point, followed by a power of ten.
    Power(usize),
}

impl Digits {
    /// Returns a format with enough digits to distinguish numbers up to `most` in steps of `step`.
    fn of(step: f64, most: f64) -> Self {
        if (1e-6..1e6).contains(&step) {
            Self::Plain((-step.log10()).ceil().max(0.0) as usize)
        } else {
            Self::Power((most / step).log10().ceil().max(0.0) as usize)
        }
    }
}

fn label(v: f64, digits: Digits) -> String {
    let v = v + 0.0;
    let text = match digits {
        Digits::Plain(digits) => format!("{v:.digits$}"),
        Digits::Power(digits) => format!("{v:.digits$e}"),
    };
    text.replace('-', "−")
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// Checks that the labels are different and in ascending order, and that the number of labels is within the limits.
    fn readable(low: f64, high: f64, share: f64) -> Result<(), TestCaseError> {
        let ticks = ticks(low, high, share);
        prop_assert!((TICKS.0..=TICKS.1).contains(&ticks.len()), "{low}..{high}: {ticks:?}");
        for pair in ticks.windows(2) {
            prop_assert!(pair[0].0 < pair[1].0 && pair[0].1 != pair[1].1, "{low}..{high}: {pair:?}");
        }
        let inside = |(v, label): &(f64, String)| (low..=high).contains(v) && label.chars().count() < 24;
        prop_assert!(ticks.iter().all(inside), "{low}..{high}: {ticks:?}");
        Ok(())
    }

    /// Returns zero, or a number of either sign with a magnitude from 1e-30 to 1e29.
    fn value() -> impl Strategy<Value = f64> {
        let magnitude = (-30.0..29.0f64, any::<bool>());
        prop_oneof![
            Just(0.0),
            -10.0..10.0f64,
            magnitude.prop_map(|(power, minus)| if minus { -10f64.powf(power) } else { 10f64.powf(power) }),
        ]
    }

    proptest! {
        #[test]
        fn every_axis_has_a_few_lines_with_labels_of_their_own(a in value(), b in value(), still in any::<bool>()) {
            let b = if still { a } else { b };
            let (low, high) = position_axis((a.min(b), a.max(b)));
            readable(low, high, 1.0)?;
            let reach = a.abs().max(0.1);
            readable(-reach, reach, 1.0)?;
            readable(0.0, a.abs().max(1e-3), 0.6)?;
        }
    }

    #[test]
    fn known_ranges_are_readable() {
        for (low, high) in [
            (0.0, 0.0),
            (0.3, 0.3 + 1e-12),
            (-1e-9, 1e-9),
            (-1.2, -1.2),
            (1e6, 1e6),
            (1e6, 1e6 + 1e-6),
            (-1e9, 1e9),
            (1e9, 1e9),
            (-3.0, 2e-17),
            (1e17, 1e17),
            (f64::MIN_POSITIVE, 5e-324),
            (-1e29, 1e29),
        ] {
            let (low, high) = position_axis((low, high));
            readable(low, high, 1.0).unwrap();
        }
        // For a typical range of values, the grid lines are at simple numbers.
        let words: Vec<String> = ticks(-1.08, 1.08, 1.0).into_iter().map(|tick| tick.1).collect();
        assert_eq!(words, ["−1", "0", "1"]);
        for none in [(f64::NAN, 1.0), (0.0, f64::INFINITY), (1.0, 1.0), (1.0, 0.0), (f64::NAN, f64::NAN)] {
            assert_eq!(ticks(none.0, none.1, 1.0), Vec::new());
        }
    }
}
