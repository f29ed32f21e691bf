//! Numbers over time, as a CSV file.

/// Named columns of numbers, row by row.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Table {
    columns: Vec<String>,
    /// Row by row; a multiple of the number of columns.
    cells: Vec<f64>,
}

impl Table {
    /// No rows yet.
    pub fn new(columns: Vec<String>) -> Self {
        Self { columns, cells: Vec::new() }
    }

    /// Their names: letters, digits, `_`, `-` and `.`, so that they need no quotes in a CSV file.
    pub fn columns(&self) -> &[String] {
        &self.columns
    }

    /// All rows, in order.
    pub fn rows(&self) -> impl ExactSizeIterator<Item = &[f64]> {
        self.cells.chunks_exact(self.columns.len().max(1))
    }

    /// Adds a row. What is missing of it is 0, what is too much of it is left out.
    pub fn push(&mut self, row: impl IntoIterator<Item = f64>) {
        let full = self.cells.len() + self.columns.len();
        self.cells.extend(row);
        self.cells.resize(full, 0.0);
    }

    /// The numbers of a column; `None` if there is none of this name.
    pub fn column(&self, name: &str) -> Option<Vec<f64>> {
        let column = self.columns.iter().position(|column| column == name)?;
        Some(self.rows().filter_map(|row| row.get(column).copied()).collect())
    }

    /// The rows of `earlier` whose first number is below that of the first row here, put in front. Nothing happens if the
    /// columns are others.
    pub fn put_before(&mut self, earlier: &Self) {
        let Some(&first) = self.cells.first() else { return };
        if earlier.columns == self.columns {
            let before = earlier.rows().filter(|row| row.first().is_some_and(|&number| number < first));
            let mut cells: Vec<f64> = before.flatten().copied().collect();
            cells.extend_from_slice(&self.cells);
            self.cells = cells;
        }
    }

    /// A line of names, then a line for each row. Numbers are written with as many digits as it takes to read the same
    /// number again.
    pub fn to_csv(&self) -> String {
        let mut text = self.columns.join(",");
        text.push('\n');
        for row in self.rows() {
            for (column, number) in row.iter().enumerate() {
                if column > 0 {
                    text.push(',');
                }
                text.push_str(&number.to_string());
            }
            text.push('\n');
        }
        text
    }

    /// What [`Self::to_csv`] wrote; `None` for anything else.
    pub fn from_csv(text: &str) -> Option<Self> {
        let mut lines = text.lines();
        let mut table = Self::new(lines.next()?.split(',').map(Into::into).collect());
        for line in lines {
            let row: Vec<f64> = line.split(',').map(str::parse).collect::<Result<_, _>>().ok()?;
            if row.len() != table.columns.len() {
                return None;
            }
            table.push(row);
        }
        Some(table)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn table(rows: &[[f64; 2]]) -> Table {
        let mut table = Table::new(vec!["tick".into(), "film_mm".into()]);
        rows.iter().for_each(|row| table.push(*row));
        table
    }

    #[test]
    fn what_is_written_is_read_again_to_the_bit() {
        let written = table(&[[0.0, 0.1 + 0.2], [60.0, 1.0e-12], [120.0, -5.0e20]]);
        assert_eq!(Table::from_csv(&written.to_csv()).unwrap(), written);
        assert_eq!(written.column("film_mm").unwrap(), [0.1 + 0.2, 1.0e-12, -5.0e20]);
        assert_eq!(written.column("film"), None);
        assert_eq!(table(&[]).to_csv(), "tick,film_mm\n");
        for torn in ["", "a,b\n1", "a,b\n1,2,3", "a,b\n1,x"] {
            assert_eq!(Table::from_csv(torn), None, "{torn}");
        }
    }

    #[test]
    fn rows_are_as_long_as_the_columns() {
        let mut table = table(&[]);
        table.push([1.0]);
        table.push([2.0, 3.0, 4.0]);
        assert_eq!(table.rows().collect::<Vec<_>>(), [&[1.0, 0.0], &[2.0, 3.0]]);
        assert_eq!(Table::default().rows().len(), 0);
    }

    #[test]
    fn earlier_rows_go_in_front_and_those_that_were_run_again_do_not() {
        let mut later = table(&[[60.0, 1.0], [120.0, 2.0]]);
        later.put_before(&table(&[[0.0, 7.0], [30.0, 8.0], [60.0, 9.0], [90.0, 9.0]]));
        assert_eq!(later, table(&[[0.0, 7.0], [30.0, 8.0], [60.0, 1.0], [120.0, 2.0]]));
        let before = later.clone();
        let mut other = Table::new(vec!["tick".into(), "snow".into()]);
        other.push([0.0, 1.0]);
        later.put_before(&other);
        assert_eq!(later, before);
    }
}
