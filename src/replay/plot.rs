//! Lines over time, as an SVG file. Text is left to the viewer to set, numbers are written to a tenth of a pixel: the same
//! plot is the same file everywhere.

use std::fmt::Write;

/// A plot of some lines over the same x.
pub(super) struct Plot {
    pub(super) title: String,
    /// With its unit.
    pub(super) x_axis: &'static str,
    /// With its unit.
    pub(super) y_axis: &'static str,
    /// In ascending order.
    pub(super) x: Vec<f64>,
    pub(super) lines: Vec<Line>,
}

/// One line; has a y for each x.
pub(super) struct Line {
    pub(super) label: String,
    pub(super) y: Vec<f64>,
}

/// Colours that are told apart with any eyes (Okabe, Ito 2008), without the yellow, which is too light for a line.
const COLORS: [&str; 7] = ["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#56b4e9", "#e69f00", "#000000"];

/// The most lines in a plot; with more it cannot be read.
pub(super) const MAX_LINES: usize = COLORS.len() * 2;

const SIZE: [f64; 2] = [900.0, 420.0];
/// Left, top, right, bottom of the axes, pixels.
const AXES: [f64; 4] = [90.0, 50.0, 690.0, 360.0];
/// Pairs of points in a line: the lowest and the highest of what falls on each.
const MAX_STEPS: usize = 600;

impl Plot {
    /// The file.
    pub(super) fn to_svg(&self) -> String {
        let [left, top, right, bottom] = AXES;
        let x = Axis::over(&self.x, 8.0);
        let all_y: Vec<f64> = self.lines.iter().flat_map(|line| &line.y).copied().chain([0.0]).collect();
        let y = Axis::over(&all_y, 5.0);
        let at_x = |value| x.place(value, left, right);
        let at_y = |value| y.place(value, bottom, top);

        let mut svg = format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {} {}\" font-family=\"sans-serif\" \
             font-size=\"13\">\n<rect width=\"100%\" height=\"100%\" fill=\"white\"/>\n",
            SIZE[0], SIZE[1],
        );
        let mut add = |line: String| {
            svg.push_str(&line);
            svg.push('\n');
        };
        add(text([left, 28.0], "start", " font-size=\"16\"", &self.title));
        for tick in x.ticks() {
            let at = at_x(tick);
            add(grid_line([at, top], [at, bottom]));
            add(text([at, bottom + 18.0], "middle", "", &x.label(tick)));
        }
        for tick in y.ticks() {
            let at = at_y(tick);
            add(grid_line([left, at], [right, at]));
            add(text([left - 8.0, at + 4.0], "end", "", &y.label(tick)));
        }
        add(text([(left + right) / 2.0, bottom + 42.0], "middle", "", self.x_axis));
        let middle = (top + bottom) / 2.0;
        let turned = format!(" transform=\"rotate(-90 24 {middle:.1})\"");
        add(text([24.0, middle], "middle", &turned, self.y_axis));
        for (number, line) in self.lines.iter().enumerate() {
            let color = COLORS[number % COLORS.len()];
            let dashes = if number < COLORS.len() { "" } else { " stroke-dasharray=\"6 3\"" };
            let style = format!("fill=\"none\" stroke=\"{color}\" stroke-width=\"1.8\"{dashes}");
            let mut points = String::new();
            for (x, y) in thinned(&self.x, &line.y) {
                // Writing to a string cannot fail.
                let _ = write!(points, "{:.1},{:.1} ", at_x(x), at_y(y));
            }
            add(format!("<polyline points=\"{}\" {style}/>", points.trim_end()));
            let key = top + 10.0 + 20.0 * number as f64;
            add(format!("<path d=\"M{:.1} {key:.1}h22\" {style}/>", right + 14.0));
            add(text([right + 42.0, key + 4.0], "start", "", &line.label));
        }
        svg.push_str("</svg>\n");
        svg
    }
}

fn text([x, y]: [f64; 2], anchor: &str, more: &str, text: &str) -> String {
    let text = text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;");
    format!("<text x=\"{x:.1}\" y=\"{y:.1}\" text-anchor=\"{anchor}\"{more}>{text}</text>")
}

fn grid_line([x, y]: [f64; 2], [x_end, y_end]: [f64; 2]) -> String {
    format!("<path d=\"M{x:.1} {y:.1}L{x_end:.1} {y_end:.1}\" stroke=\"#ddd\"/>")
}

/// The points of a line that are drawn: of what would fall on the same step, the lowest and the highest, in their order, so
/// that no peak is lost.
fn thinned<'a>(x: &'a [f64], y: &'a [f64]) -> impl Iterator<Item = (f64, f64)> + 'a {
    let count = x.len().min(y.len());
    let per_step = count.div_ceil(MAX_STEPS).max(1);
    (0..count).step_by(per_step).flat_map(move |from| {
        let step = from..(from + per_step).min(count);
        let lowest = step.clone().min_by(|&a, &b| y[a].total_cmp(&y[b])).unwrap_or(from);
        let highest = step.max_by(|&a, &b| y[a].total_cmp(&y[b])).unwrap_or(from);
        let (first, last) = (lowest.min(highest), lowest.max(highest));
        [first, last].into_iter().take(if first == last { 1 } else { 2 }).map(move |at| (x[at], y[at]))
    })
}

/// From where to where an axis goes, and how far apart its ticks are.
struct Axis {
    low: f64,
    high: f64,
    step: f64,
}

impl Axis {
    /// Holds all values, between two ticks; with about `count` ticks at 1, 2 or 5 times a power of ten.
    fn over(values: &[f64], count: f64) -> Self {
        let finite = || values.iter().copied().filter(|value| value.is_finite());
        let low = finite().fold(f64::INFINITY, f64::min);
        let high = finite().fold(f64::NEG_INFINITY, f64::max);
        // Without any width, one: also where there is no value at all.
        let low = if low.is_finite() { low } else { 0.0 };
        let high = if high > low { high } else { low + 1.0 };
        let coarse = (high - low) / count;
        let power = 10.0f64.powf(coarse.log10().floor());
        // Rounding must not make it the next one.
        let enough = |step: &f64| step * power >= coarse * (1.0 - 1.0e-9);
        let step = [1.0, 2.0, 5.0].into_iter().find(enough).unwrap_or(10.0) * power;
        Self { low: (low / step).floor() * step, high: (high / step).ceil() * step, step }
    }

    fn ticks(&self) -> impl Iterator<Item = f64> {
        let count = ((self.high - self.low) / self.step).round() as u32;
        let (low, step) = (self.low, self.step);
        (0..=count).map(move |tick| low + f64::from(tick) * step)
    }

    /// As many digits as the step has.
    fn label(&self, tick: f64) -> String {
        let digits = (-self.step.log10() - 1.0e-9).ceil().clamp(0.0, 12.0) as usize;
        // Not -0.
        format!("{:.digits$}", if tick.abs() < self.step / 2.0 { 0.0 } else { tick })
    }

    /// Where a value lies between two pixels.
    fn place(&self, value: f64, from: f64, to: f64) -> f64 {
        let part = (value - self.low) / (self.high - self.low);
        from + (to - from) * if part.is_finite() { part.clamp(0.0, 1.0) } else { 0.0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn plot(y: Vec<f64>) -> Plot {
        Plot {
            title: "a < b & c".into(),
            x_axis: "time, s",
            y_axis: "film, mm",
            x: (0..y.len()).map(|second| second as f64).collect(),
            lines: vec![Line { label: "bunny".into(), y }],
        }
    }

    #[test]
    fn ticks_are_round_and_hold_all_values() {
        for (values, step, ends) in [
            ([0.0, 1.0], 0.2, [0.0, 1.0]),
            ([0.0, 0.37], 0.1, [0.0, 0.4]),
            ([-3.0, 120.0], 50.0, [-50.0, 150.0]),
            ([7.0, 7.0], 0.2, [7.0, 8.0]),
        ] {
            let axis = Axis::over(&values, 5.0);
            let close = |a: f64, b: f64| (a - b).abs() < 1.0e-9;
            assert!(close(axis.step, step), "{values:?}: {}", axis.step);
            assert!(close(axis.low, ends[0]) && close(axis.high, ends[1]), "{values:?}");
            assert!(close(axis.ticks().last().unwrap(), axis.high));
        }
        assert_eq!(Axis::over(&[0.0, 0.37], 5.0).label(0.30000000000000004), "0.3");
        assert_eq!(Axis::over(&[-3.0, 120.0], 5.0).label(-0.0), "0");
        assert_eq!(Axis::over(&[f64::NAN], 5.0).ticks().count(), 6);
    }

    #[test]
    fn values_lie_where_the_axes_say() {
        let svg = plot(vec![0.0, 1.0, 0.5]).to_svg();
        assert!(svg.contains("points=\"90.0,360.0 390.0,50.0 690.0,205.0\""), "{svg}");
        assert!(svg.contains("a &lt; b &amp; c") && svg.contains(">film, mm</text>"), "{svg}");
        assert_eq!(svg.matches("<polyline").count(), 1);
        for empty in [vec![], vec![0.0], vec![f64::NAN, f64::INFINITY]] {
            let svg = plot(empty).to_svg();
            assert!(svg.ends_with("</svg>\n") && !svg.contains("NaN") && !svg.contains("inf"), "{svg}");
        }
    }

    #[test]
    fn long_lines_are_thinned_and_keep_their_peaks() {
        let mut y = vec![0.0; 100_000];
        (y[54_321], y[77_777]) = (9.0, -4.0);
        let x: Vec<f64> = (0..y.len()).map(|at| at as f64).collect();
        let points: Vec<_> = thinned(&x, &y).collect();
        assert!(points.len() <= 2 * MAX_STEPS, "{}", points.len());
        assert!(points.contains(&(54_321.0, 9.0)) && points.contains(&(77_777.0, -4.0)));
        assert!(points.is_sorted_by(|a, b| a.0 < b.0));
        let few: Vec<_> = thinned(&[1.0, 2.0], &[5.0, 6.0]).collect();
        assert_eq!(few, [(1.0, 5.0), (2.0, 6.0)]);
    }
}
