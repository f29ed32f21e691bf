//! The plots of a run: `series.csv` and `timings.csv` at a glance.

use std::path::Path;

use super::plot::{Line, MAX_LINES, Plot};
use super::series::SeriesTables;
use super::table::Table;
use super::{ReplayError, write_atomic};
use crate::overload::STAGES;

/// The folder of the plots, beside the report.
pub(super) const PLOTS_FOLDER: &str = "plots";

/// All plots there can be; `matter.svg` is made where there is any.
pub(super) const PLOT_FILES: [&str; 7] =
    ["wetness.svg", "film.svg", "absorbed.svg", "water.svg", "particles.svg", "matter.svg", "timings.svg"];

/// Writes the plots of a run of `scenario` into the folder `out`.
pub(super) fn write_plots(out: &Path, scenario: &str, tables: &SeriesTables) -> Result<(), ReplayError> {
    for (file, plot) in PLOT_FILES.iter().zip(plots(scenario, tables)) {
        if let Some(plot) = plot {
            write_atomic(&out.join(PLOTS_FOLDER).join(file), plot.to_svg().as_bytes())?;
        }
    }
    Ok(())
}

/// In the order of [`PLOT_FILES`].
fn plots(scenario: &str, SeriesTables { rows, timings }: &SeriesTables) -> [Option<Plot>; 7] {
    let plot = |table: &Table, what: &str, y_axis, lines| Plot {
        title: format!("{scenario}: {what}"),
        x_axis: "weather time, s",
        y_axis,
        x: table.column("seconds").unwrap_or_default(),
        lines,
    };
    let matter = named(rows, &[("dust", "dust_ml"), ("mud", "mud_ml"), ("snow, as water", "snow_ml")], sum);
    let is_any = matter.iter().any(|line| line.y.iter().any(|&ml| ml > 0.0));
    let water = [
        ("sent out", "emitted_ml"),
        ("melted", "melted_ml"),
        ("on surfaces", "on_surfaces_ml"),
        ("evaporated", "evaporated_ml"),
        ("run off", "run_off_ml"),
        ("missed", "missed_ml"),
        ("in flight", "in_flight_ml"),
        ("wiped", "wiped_ml"),
    ];
    let mut particles = named(rows, &[("in flight", "particles_alive")], Table::column);
    particles.extend(named(
        rows,
        &[("born per s", "particles_emitted"), ("hits per s", "particles_hit")],
        rate,
    ));
    let mut stages: Vec<Line> = STAGES.iter().filter_map(|stage| stage_line(timings, stage)).collect();
    stages.extend(stage_line(timings, "outside"));
    [
        Some(plot(
            rows,
            "how wet it looks",
            "part of the area that is wet",
            of_surfaces(rows, "wet_fraction"),
        )),
        Some(plot(rows, "film", "mean film, mm", of_surfaces(rows, "film_mm"))),
        Some(plot(rows, "absorbed water", "mean absorbed, mm", of_surfaces(rows, "absorbed_mm"))),
        Some(plot(rows, "where the water is", "water, ml", named(rows, &water, Table::column))),
        Some(plot(rows, "particles", "particles", particles)),
        is_any.then(|| plot(rows, "matter on all surfaces", "volume, ml", matter)),
        Some(plot(timings, "wall-clock time of a tick", "mean time, ms", stages)),
    ]
}

/// A line for each pair of a label and a column, with what `read` makes of the column.
fn named(
    table: &Table,
    columns: &[(&str, &str)],
    read: impl Fn(&Table, &str) -> Option<Vec<f64>>,
) -> Vec<Line> {
    let line = |&(label, column): &(&str, &str)| Some(Line { label: label.into(), y: read(table, column)? });
    columns.iter().filter_map(line).collect()
}

fn stage_line(timings: &Table, stage: &str) -> Option<Line> {
    Some(Line { label: stage.into(), y: timings.column(&format!("{stage}_ms"))? })
}

/// A line for each surface; of more than can be told apart, those that get the highest.
fn of_surfaces(rows: &Table, column: &str) -> Vec<Line> {
    let suffix = format!(".{column}");
    let line = |name: &String| {
        let label = name.strip_suffix(suffix.as_str())?.to_owned();
        Some(Line { label, y: rows.column(name)? })
    };
    let mut lines: Vec<Line> = rows.columns().iter().filter_map(line).collect();
    let count = lines.len();
    if count > MAX_LINES {
        let highest = |line: &Line| line.y.iter().copied().fold(0.0, f64::max);
        lines.sort_by(|a, b| highest(b).total_cmp(&highest(a)));
        lines.truncate(MAX_LINES - 1);
        let label = format!("({} lower ones)", count - lines.len());
        lines.push(Line { label, y: Vec::new() });
    }
    lines
}

/// The sum of a column of all surfaces.
fn sum(rows: &Table, column: &str) -> Option<Vec<f64>> {
    let suffix = format!(".{column}");
    let columns: Vec<usize> = (0..rows.columns().len())
        .filter(|&column| rows.columns()[column].ends_with(suffix.as_str()))
        .collect();
    let of_row = |row: &[f64]| columns.iter().filter_map(|&column| row.get(column)).sum::<f64>();
    Some(rows.rows().map(of_row).collect())
}

/// How much a column grows per second; 0 in the first row.
fn rate(rows: &Table, column: &str) -> Option<Vec<f64>> {
    let (seconds, counts) = (rows.column("seconds")?, rows.column(column)?);
    let growth = seconds.windows(2).zip(counts.windows(2)).map(|(seconds, counts)| {
        let passed = seconds[1] - seconds[0];
        if passed > 0.0 { (counts[1] - counts[0]) / passed } else { 0.0 }
    });
    Some([0.0].into_iter().chain(growth).take(counts.len()).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Columns with their numbers, row by row.
    fn table(columns: &[&str], rows: &[&[f64]]) -> Table {
        let mut table = Table::new(columns.iter().map(|&column| column.to_owned()).collect());
        rows.iter().for_each(|row| table.push(row.iter().copied()));
        table
    }

    #[test]
    fn counts_become_rates_and_surfaces_sums() {
        let rows = table(
            &["seconds", "particles_hit", "a.dust_ml", "b.dust_ml"],
            &[&[0.0, 0.0, 1.0, 2.0], &[2.0, 100.0, 3.0, 4.0], &[2.5, 100.0, 5.0, 6.0]],
        );
        assert_eq!(rate(&rows, "particles_hit").unwrap(), [0.0, 50.0, 0.0]);
        assert_eq!(sum(&rows, "dust_ml").unwrap(), [3.0, 7.0, 11.0]);
        assert!(rate(&Table::new(vec!["seconds".into(), "a".into()]), "a").unwrap().is_empty());
    }

    #[test]
    fn of_many_surfaces_those_that_get_wettest_are_shown() {
        let names: Vec<String> = (0..40).map(|number| format!("s{number}.wet_fraction")).collect();
        let mut rows = Table::new(names);
        rows.push((0..40).map(f64::from));
        let lines = of_surfaces(&rows, "wet_fraction");
        assert_eq!(lines.len(), MAX_LINES);
        assert_eq!((lines[0].label.as_str(), lines[0].y[0]), ("s39", 39.0));
        assert_eq!(lines[MAX_LINES - 1].label, format!("({} lower ones)", 40 - (MAX_LINES - 1)));
    }

    #[test]
    fn matter_is_plotted_where_there_is_any() {
        let tables = |dust| SeriesTables {
            rows: table(&["seconds", "a.dust_ml"], &[&[0.0, dust]]),
            timings: table(&["seconds", "flow_ms"], &[&[0.0, 1.0]]),
        };
        assert!(plots("rain.ron", &tables(0.0))[5].is_none());
        let folder = tempfile::tempdir().unwrap();
        write_plots(folder.path(), "rain.ron", &tables(2.0)).unwrap();
        for file in PLOT_FILES {
            let svg = std::fs::read_to_string(folder.path().join(PLOTS_FOLDER).join(file)).unwrap();
            assert!(svg.contains("rain.ron: ") && svg.contains("weather time, s"), "{file}");
        }
    }
}
