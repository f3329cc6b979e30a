//! A small picture of a run: commanded and measured position of the six joints, and the tracking error below them.

use std::fmt::Write;

use super::curves::Curve;
use super::{ReportInput, escape};

const WIDTH: f64 = 960.0;
const HEIGHT: f64 = 560.0;
/// Points per line: enough for its width in pixels.
const POINTS: usize = 260;

/// Light colours here, dark ones by the reader's preference, as the page has them.
const STYLE: &str = "\
svg{--paper:#fffefb;--ink:#1b1f24;--soft:#5f666f;--grid:#eceae2;--j0:#2559d6;--j1:#dd6412;--j2:#0c8a5b;--j3:#c02c7c;--j4:#7547cf;--j5:#94780a}\
@media (prefers-color-scheme:dark){svg{--paper:#161a20;--ink:#e9ebee;--soft:#9aa3af;--grid:#262c35;--j0:#7aa5ff;--j1:#ff9d57;--j2:#43d39e;--j3:#ff77b6;--j4:#b79bff;--j5:#e3c84c}}\
text{font-family:system-ui,-apple-system,'Segoe UI','Noto Sans',sans-serif;font-size:12px;fill:var(--soft)}\
.t{font-size:19px;font-weight:600;fill:var(--ink);letter-spacing:-.3px}.n{font-weight:600;fill:var(--ink)}\
.g{stroke:var(--grid);stroke-width:1}.c{fill:none;stroke-width:6;stroke-linejoin:round;opacity:.25}\
.m{fill:none;stroke-width:1.5;stroke-linejoin:round}.e{fill:none;stroke-width:1.1;stroke-linejoin:round}";

/// One rectangle of the picture with its axes.
struct Panel {
    left: f64,
    top: f64,
    width: f64,
    height: f64,
    time: (f64, f64),
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
            if v.is_finite() {
                let _ = write!(path, "{}{:.1} {:.1}", if pen_down { 'L' } else { 'M' }, self.x(t), self.y(v));
            }
            pen_down = v.is_finite();
        }
        path
    }

    fn horizontal(&self, svg: &mut String, v: f64, label: &str) {
        let y = self.y(v);
        let (l, r) = (self.left, self.left + self.width);
        let _ = writeln!(svg, r#"<path class="g" d="M{l:.1} {y:.1}H{r:.1}"/>"#);
        let _ =
            writeln!(svg, r#"<text x="{:.1}" y="{:.1}" text-anchor="end">{label}</text>"#, l - 7.0, y + 4.0);
    }
}

/// The picture as SVG; it follows the reader's light or dark setting.
pub fn picture_svg(input: &ReportInput<'_>) -> String {
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {WIDTH} {HEIGHT}\" role=\"img\">\n<style>{STYLE}</style>\n\
         <rect width=\"{WIDTH}\" height=\"{HEIGHT}\" rx=\"14\" fill=\"var(--paper)\"/>\n"
    );
    if let Some((first_s, last_s)) = input.digest.span_s() {
        let time = (first_s, last_s.max(first_s + 1e-3));
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
    let (low, high) = bounds(measured.iter().chain(&set)).unwrap_or((-1.0, 1.0));
    let room = ((high - low) * 0.08).max(0.02);
    let (column, row) = ((j % 3) as f64, (j / 3) as f64);
    let panel = Panel {
        left: 64.0 + column * 300.0,
        top: 102.0 + row * 152.0,
        width: 236.0,
        height: 106.0,
        time,
        value: (low - room, high + room),
    };
    let _ = writeln!(
        svg,
        r#"<text class="n" x="{:.1}" y="{:.1}">Joint {}</text>"#,
        panel.left,
        panel.top - 8.0,
        j + 1
    );
    let step = tick_step(high - low);
    let mut v = ((low - room) / step).ceil() * step;
    while v <= high + room {
        panel.horizontal(svg, v, &label(v, step));
        v += step;
    }
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
    let step = tick_step(2.0 * reach);
    let most = (reach / step).floor() as i64;
    for i in -most..=most {
        panel.horizontal(svg, i as f64 * step, &label(i as f64 * step, step));
    }
    for (j, line) in lines.iter().enumerate() {
        let _ = writeln!(svg, r#"<path class="e" style="stroke:var(--j{j})" d="{}"/>"#, panel.path(line));
    }
    let step = tick_step((time.1 - time.0) * 0.6);
    let mut t = (time.0 / step).ceil() * step;
    while t <= time.1 + 1e-9 {
        let text = label(t - time.0, step);
        let _ = writeln!(svg, r#"<text x="{:.1}" y="530" text-anchor="middle">{text} s</text>"#, panel.x(t));
        t += step;
    }
}

/// Times and values of a curve.
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

/// The lowest and the highest value of each bucket: a peak of one sample stays visible.
fn extremes(points: &[(f64, f64)]) -> Vec<(f64, f64)> {
    let bucket = points.len().div_ceil(2 * POINTS).max(1);
    let pair = |bucket: &[(f64, f64)]| {
        let values = bucket.iter().map(|point| point.1).filter(|v| v.is_finite());
        let low = values.clone().reduce(f64::min).unwrap_or(f64::NAN);
        let high = values.reduce(f64::max).unwrap_or(f64::NAN);
        [(bucket[0].0, low), (bucket[bucket.len() / 2].0, high)]
    };
    points.chunks(bucket).flat_map(pair).collect()
}

fn bounds<'a>(points: impl Iterator<Item = &'a (f64, f64)>) -> Option<(f64, f64)> {
    points.filter(|p| p.1.is_finite()).fold(None, |b, &(_, v)| {
        let (low, high) = b.unwrap_or((v, v));
        Some((low.min(v), high.max(v)))
    })
}

/// 1, 2 or 5 times a power of ten, so that some four steps fill `span`.
fn tick_step(span: f64) -> f64 {
    let rough = (span / 4.0).max(1e-6);
    let power = 10f64.powf(rough.log10().floor());
    let step = [1.0, 2.0, 5.0, 10.0].into_iter().find(|m| m * power >= rough);
    step.unwrap_or(10.0) * power
}

fn label(v: f64, step: f64) -> String {
    let digits = (-step.log10()).ceil().max(0.0) as usize;
    let text = format!("{:.digits$}", v + 0.0);
    text.replace('-', "−")
}
