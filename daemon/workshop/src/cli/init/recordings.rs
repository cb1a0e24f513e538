//! Recordings without a description: their encoding, their names in a dataset, and the dataset that they would make.

use std::borrow::Cow;
use std::path::{Path, PathBuf};

use dynocar::cli::Failure;
use dynocar::text_file::{read_beginning, read_bytes};
use dynocar_analysis::dataset::guess::layout;
use dynocar_analysis::dataset::text_layout::{TrainRows, decoded, guessed};
use dynocar_analysis::dataset::trains::{TrainsColumn, only};
use dynocar_analysis::dataset::{
    ColumnMapping, DatasetError, DatasetFiles, DatasetHead, FileProblem, Run, RunColumns,
    SourcePosition, TrainColumn, formats,
};
use encoding_rs::{Encoding, UTF_8, UTF_16BE, UTF_16LE};

use crate::dataset::{self, real};
use crate::formats::{RunFile, RunReader, run_reader};

/// Name and text of a file.
pub type NamedText = (String, String);

/// Returns the texts of the files, and the encoding that they share.
///
/// # Errors
///
/// When a file cannot be read, or has another encoding than the others.
pub fn texts(
    paths: &[PathBuf],
    given: Option<&'static Encoding>,
) -> Result<(Vec<NamedText>, &'static Encoding), Failure> {
    let mut files = Vec::new();
    if let Some(tables) = tables(paths)? {
        return Ok((tables, UTF_8));
    }
    for path in paths {
        let label = path.display().to_string();
        let unread = |problem: FileProblem| problem.of(&label);
        // In UTF-16 every other byte may be 0, which is a mark of other formats elsewhere.
        let begins = guessed(&read_beginning(path, 2).map_err(unread)?);
        let is_wide = [UTF_16LE, UTF_16BE].contains(&begins);
        let bytes = read_bytes(path, if is_wide { begins } else { UTF_8 }).map_err(unread)?;
        files.push((label, given.unwrap_or_else(|| guessed(&bytes)), bytes));
    }
    // A file of plain letters only is valid in any of them.
    let is_plain = |bytes: &[u8]| bytes.is_ascii();
    let special = files.iter().find(|(_, _, bytes)| !is_plain(bytes));
    let (first, encoding) =
        special.map_or((String::new(), UTF_8), |(label, encoding, _)| (label.clone(), *encoding));
    let encoding = given.unwrap_or(encoding);
    let mut texts = Vec::new();
    for (label, own, bytes) in files {
        if own != encoding && !is_plain(&bytes) {
            let words = format!(
                "{label}: the encoding is {}, but {} in {first}: files of one dataset are laid out \
                 alike",
                own.name(),
                encoding.name()
            );
            return Err(Failure::At(SourcePosition::whole(&label), words));
        }
        let text = decoded(bytes, encoding).and_then(|it| formats::of_run(&label).rows(it));
        let text = text.map_err(|problem| problem.of(&label))?;
        texts.push((label, text));
    }
    Ok((texts, encoding))
}

/// Files that a library reads as texts of their columns of numbers and times, as CSV has them; `None` for texts.
fn tables(paths: &[PathBuf]) -> Result<Option<Vec<NamedText>>, Failure> {
    let readers: Vec<_> = paths.iter().filter_map(run_reader).collect();
    match readers.len() {
        0 => return Ok(None),
        count if count == paths.len() => {}
        _ => return Err(Failure::Input("--csv: expected files of one format".into())),
    }
    let table = |(path, read): (&PathBuf, RunReader)| {
        let label = path.display().to_string();
        let refused =
            |words: String| Failure::At(SourcePosition::whole(&label), format!("{label}: {words}"));
        let RunColumns { columns: names, trains } =
            read(RunFile::OnDisk(path), &[], &TrainRows::Unsaid)
                .map_err(|it| refused(it.to_string()))?;
        let mut columns: Vec<(String, Result<Vec<f64>, String>)> = Vec::new();
        for name in names.iter().map(|it| it.name.clone()) {
            let numbers = numbers_of((path, read), &name);
            if trains.as_ref().is_none_or(|it| it.name != name.trim()) {
                columns.push((name, numbers));
            }
        }
        if columns.iter().all(|it| it.1.is_err()) {
            let names = names.iter().map(|it| format!("'{}'", it.name)).collect::<Vec<_>>();
            let words = "expected columns of numbers and times, found texts, lists or structures";
            return Err(refused(format!("{words}: {}", names.join(", "))));
        }
        Ok((label, as_csv(&columns, trains.as_ref())))
    };
    paths.iter().zip(readers).map(table).collect::<Result<_, Failure>>().map(Some)
}

/// Returns a column's numbers, times in s.
fn numbers_of((path, read): (&Path, RunReader), name: &str) -> Result<Vec<f64>, String> {
    let mapping = ColumnMapping::of_time(name);
    let found = read(RunFile::OnDisk(path), &[mapping], &TrainRows::All);
    let found = found.map_err(|it| it.to_string())?;
    found.columns.into_iter().find_map(|it| it.values).ok_or_else(|| "no values".into())
}

/// Columns as text; one that cannot be mapped holds the type of its contents.
fn as_csv(columns: &[(String, Result<Vec<f64>, String>)], trains: Option<&TrainColumn>) -> String {
    let quoted = |text: &str| format!("\"{}\"", text.replace('"', "\"\""));
    let names = columns.iter().map(|it| &it.0[..]).chain(trains.map(|it| &it.name[..]));
    let mut text = names.map(quoted).collect::<Vec<_>>().join(",") + "\n";
    let mut train_cells = trains.into_iter().flat_map(TrainColumn::cells);
    let rows = columns.iter().find_map(|(_, values)| values.as_ref().ok()).map_or(0, Vec::len);
    for row in 0..rows {
        let cell = |(_, values): &(String, Result<Vec<f64>, String>)| match values {
            Ok(values) if values[row].is_nan() => String::new(),
            Ok(values) => values[row].to_string(),
            Err(problem) => quoted(problem.rsplit(" found ").next().unwrap_or_default()),
        };
        let train = train_cells.next().map(|it| if it.is_empty() { it.into() } else { quoted(it) });
        let cells = columns.iter().map(cell).chain(train);
        text += &(cells.collect::<Vec<_>>().join(",") + "\n");
    }
    text
}

/// The rows of one train in files of several.
pub struct OfTrain {
    /// Which they are.
    pub rows: TrainRows,
    /// The files with them alone.
    pub texts: Vec<String>,
}

/// Returns the rows of the train that is named, with the delimiter of the files where it is given, or of all where the files hold one.
///
/// # Errors
///
/// Files of several trains of which none is named, and a name that is none of theirs, are an input failure.
pub fn of_train(
    files: &[NamedText],
    delimiter: Option<u8>,
    named: Option<&str>,
) -> Result<Option<OfTrain>, Failure> {
    let layouts = files.iter().map(|(label, text)| layout(label, text, delimiter));
    // A file without a layout is refused later.
    let Ok(layouts) = layouts.collect::<Result<Vec<_>, _>>() else { return Ok(None) };
    let trains =
        files.iter().zip(&layouts).map(|((_, text), it)| TrainsColumn::new(text, &it.text));
    let trains: Vec<Option<TrainsColumn>> = trains.collect();
    let Some(value) = named else {
        let mut several = files.iter().zip(&trains);
        let several = several.find_map(|((label, _), it)| Some((label, it.as_ref()?)));
        return match several.filter(|(_, it)| it.is_interleaved()) {
            None => Ok(None),
            Some((label, it)) => Err(Failure::At(
                SourcePosition::whole(label),
                format!("{label}: {}; choose one by --train", it.words()),
            )),
        };
    };
    let Some(column) = trains.into_iter().flatten().next().map(|it| it.name) else {
        let words = "--train: expected files whose rows a column distinguishes by their train";
        return Err(Failure::Input(words.into()));
    };
    let own = files.iter().zip(&layouts).map(|((label, text), it)| {
        only(label, text, &it.text, (&column, value)).map(Cow::into_owned)
    });
    let texts = own.collect::<Result<_, _>>()?;
    Ok(Some(OfTrain { rows: TrainRows::Of { column, value: value.into() }, texts }))
}

/// Returns an error of names that may be read in other letters than they were written in: where their encoding was
/// assumed, it says so.
pub fn with_encoding(
    error: DatasetError,
    encoding: &'static Encoding,
    given: Option<&'static Encoding>,
) -> Failure {
    if given.is_some() || encoding == UTF_8 {
        return error.into();
    }
    let name = encoding.name().to_lowercase();
    Failure::At(
        error.place.clone(),
        format!(
            "{error}; the letters are taken for {name}, since the file is no UTF-8: --encoding says another"
        ),
    )
}

/// Returns the paths of existing files from a folder that need not be there yet.
///
/// # Errors
///
/// A file that is given twice, or whose name no TOML file can hold, is an input failure.
pub fn from_folder(folder: &Path, files: &[PathBuf]) -> Result<Vec<String>, Failure> {
    let mut seen: Vec<PathBuf> = Vec::new();
    let mut paths = Vec::new();
    for file in files {
        let refuse = |words: &str| {
            let label = file.display().to_string();
            Failure::At(SourcePosition::whole(&label), format!("{label}: {words}"))
        };
        let full = real(file);
        if seen.contains(&full) {
            return Err(refuse("expected every run once, found the file twice"));
        }
        let path = dataset::from_folder(folder, file);
        let text = path.to_str().ok_or_else(|| refuse("expected a name in UTF-8"))?;
        paths.push(text.into());
        seen.push(full);
    }
    Ok(paths)
}

/// The dataset's files.
pub struct Draft<'t> {
    /// Where they will be.
    pub folder: &'t Path,
    /// For each file: its path as the dataset names it, its name in messages where that is not the path from the
    /// folder, and its present or future text.
    pub files: Vec<(&'t str, Option<&'t str>, &'t str)>,
}

impl DatasetFiles for Draft<'_> {
    fn read(&self, path: &str) -> Result<String, FileProblem> {
        self.file(path).map(|(_, text)| text.into()).ok_or(FileProblem::Missing)
    }

    fn label(&self, path: &str) -> String {
        let label = self.file(path).and_then(|(label, _)| label);
        label.map_or_else(|| self.folder.join(path).display().to_string(), Into::into)
    }
}

impl Draft<'_> {
    fn file(&self, path: &str) -> Option<(Option<&str>, &str)> {
        self.files.iter().find(|file| file.0 == path).map(|&(_, label, text)| (label, text))
    }

    /// Reads the dataset with all its runs.
    ///
    /// # Errors
    ///
    /// The first mistake, with file and line.
    pub fn read(&self) -> Result<(DatasetHead, Vec<Run>), Failure> {
        let head = DatasetHead::open(self)?;
        let runs = (0..head.manifest.runs.len()).map(|index| head.read_run(self, index));
        let runs = runs.collect::<Result<_, _>>()?;
        Ok((head, runs))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_is_named_from_the_folder_whether_it_is_there_or_not() {
        let site = tempfile::tempdir().unwrap();
        let at = |name: &str| site.path().join(name);
        std::fs::create_dir_all(at("raw/day")).unwrap();
        std::fs::write(at("raw/day/1.csv"), "").unwrap();
        let named = |folder: &str| from_folder(&at(folder), &[at("raw/day/1.csv")]).unwrap();
        assert_eq!(named("raw"), ["day/1.csv"]);
        assert_eq!(named("raw/day"), ["1.csv"]);
        assert_eq!(named("new/train"), ["../../raw/day/1.csv"]);
        std::os::unix::fs::symlink(at("raw"), at("link")).unwrap();
        assert_eq!(named("link"), ["day/1.csv"]);
        let twice = [at("raw/day/1.csv"), at("link/day/./1.csv")];
        assert!(from_folder(&at("raw"), &twice).is_err());
    }
}
