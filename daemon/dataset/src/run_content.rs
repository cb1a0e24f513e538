//! Contents of a run's file: rows of text, or columns that another program has read.

/// Contents of a run's file.
#[derive(Clone, Debug, PartialEq)]
pub enum RunContent {
    /// Rows of text, laid out as the manifest says.
    Text(String),
    /// All columns of a file of Parquet. Where a mapped one is not there, none has values.
    Columns(Vec<RunColumn>),
}

/// A column of a run's file that is no text.
#[derive(Clone, Debug, PartialEq)]
pub struct RunColumn {
    /// Its name.
    pub name: String,
    /// A mapped column's numbers, times in the unit that is declared for them; `NaN` where missing.
    pub values: Option<Vec<f64>>,
}
