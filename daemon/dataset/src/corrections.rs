//! `[corrections]` and `[[extra]]` of a `train.toml`: additions to the declared model by measured runs.

use dynocar_model::terms::extra::{Covariate, CovariateFactor, ExtraResistance, FACTORS_MAX, Form};

use super::document::Item;
use super::error::DatasetError;
use super::keys::extra::{FACTORS, FORCE};
use super::keys::factor::{FORM, OF};
use super::keys::{self, extra};

/// Reads the tables of a train file; the list is empty where there are no tables.
pub(super) fn read_extra(root: &Item) -> Result<Vec<ExtraResistance>, DatasetError> {
    root.tables(extra::TABLE)?.iter().map(extra_of).collect()
}

fn extra_of(section: &Item) -> Result<ExtraResistance, DatasetError> {
    keys::allow(section, extra::KEYS)?;
    let n_per_kn = FORCE.number(section)?.unwrap_or(0.0);
    let tables = section.tables(FACTORS.name)?;
    if tables.is_empty() || tables.len() > FACTORS_MAX {
        return Err(FACTORS.refused(section, format_args!("{} of them", tables.len())));
    }
    let factors = tables.iter().map(factor).collect::<Result<_, _>>()?;
    Ok(ExtraResistance { n_per_kn, factors })
}

fn factor(section: &Item) -> Result<CovariateFactor, DatasetError> {
    let covariates = Covariate::ALL.map(Covariate::name);
    let named = (("covariate", OF.rule.allowed), Covariate::from_name);
    let of = section.need_named(OF.name, named.0, named.1, covariates)?;
    let forms = Form::ALL.map(Form::name);
    let named = (("form", FORM.rule.allowed), Form::from_name);
    let form = section.need_named(FORM.name, named.0, named.1, forms)?;
    let keys: Vec<&str> = [OF.name, FORM.name].iter().chain(form.numbers()).copied().collect();
    section.allow(&keys)?;
    let mut numbers = [0.0; 2];
    for (number, name) in numbers.iter_mut().zip(form.numbers()) {
        *number = section.required(name, "a number", ..)?;
    }
    match form.refusal(numbers) {
        None => Ok(CovariateFactor { of, form, numbers }),
        Some(expected) => {
            let named = form.numbers().iter().zip(numbers);
            let found: Vec<String> =
                named.map(|(name, number)| format!("{name} = {number}")).collect();
            let found = format!("{} with {}", form.name(), found.join(", "));
            Err(section.key_out_of_range(FORM.name, &found, expected))
        }
    }
}

#[cfg(test)]
mod tests {
    use crate::parse_train;
    use dynocar_model::train::Corrections;

    const TRAIN: &str = "[train]\nmass_t = 10\nlength_m = 1\nrotating_mass_factor = 0\n\
                         [resistance]\na = 1\nb = 0\nc = 0\n";

    #[test]
    fn corrections_are_read_and_the_rest_corrects_nothing() {
        let text = format!("{TRAIN}[corrections]\ntunnel_c_factor = 1.9\nspeed_scale = 0.98\n");
        let known = parse_train("train.toml", &text).unwrap().corrections;
        let expected = Corrections { tunnel_c_factor: 1.9, speed_scale: 0.98, ..Corrections::NONE };
        assert_eq!(known, expected);
        assert_eq!(parse_train("train.toml", TRAIN).unwrap().corrections, Corrections::NONE);
    }

    #[test]
    fn a_wrong_correction_is_refused_with_what_was_allowed() {
        let text = format!("{TRAIN}[corrections]\nspeed_scale = 98\n");
        assert_eq!(
            parse_train("train.toml", &text).unwrap_err().to_string(),
            "train.toml:10: corrections.speed_scale = 98: expected from 0.8 to 1.25"
        );
    }
}

#[cfg(test)]
mod extra_tests {
    use crate::parse_train;
    use dynocar_model::terms::extra::{Covariate, CovariateFactor, ExtraResistance, Form};

    const TRAIN: &str = "[train]\nmass_t = 10\nlength_m = 1\nrotating_mass_factor = 0\n\
                         [resistance]\na = 1\nb = 0\nc = 0\n[[extra]]\nn_per_kn = 0.8\n";

    fn refusal(extra: &str) -> String {
        parse_train("train.toml", &format!("{TRAIN}{extra}")).unwrap_err().to_string()
    }

    #[test]
    fn a_force_with_two_factors_is_read() {
        let text = "[[extra.factor]]\nof = \"speed_mps\"\nform = \"hyperbola\"\nbelow = 15\n\
                    least = 3\n[[extra.factor]]\nof = \"ambient_temperature_degc\"\n\
                    form = \"below\"\nuntil = 5\nspan = 10\n";
        let train = parse_train("train.toml", &format!("{TRAIN}{text}")).unwrap();
        let hyperbola =
            CovariateFactor { of: Covariate::Speed, form: Form::Hyperbola, numbers: [15.0, 3.0] };
        let below =
            CovariateFactor { of: Covariate::Temperature, form: Form::Below, numbers: [5.0, 10.0] };
        assert_eq!(
            train.extra,
            [ExtraResistance { n_per_kn: 0.8, factors: vec![hyperbola, below] }]
        );
    }

    #[test]
    fn what_is_wrong_is_named_with_line_and_choices() {
        let no_factor = refusal("");
        assert!(no_factor.contains("train.toml:"), "{no_factor}");
        assert!(no_factor.contains("expected one or two tables"), "{no_factor}");
        let factor = "[[extra.factor]]\nof = \"speed_mps\"\n";
        let misspelt = refusal(&factor.replace("speed_mps", "sped_mps"));
        assert!(misspelt.contains("did you mean 'speed_mps'?"), "{misspelt}");
        let form = refusal(&format!("{factor}form = \"sine\"\n"));
        assert!(form.contains("unknown form 'sine'"), "{form}");
        let number = refusal(&format!("{factor}form = \"hyperbola\"\nbelow = 15\n"));
        assert!(number.contains("least"), "{number}");
        let order = refusal(&format!("{factor}form = \"hyperbola\"\nbelow = 2\nleast = 3\n"));
        assert!(order.contains("below = 2, least = 3"), "{order}");
        let further = refusal(&format!("{factor}form = \"decay\"\nover = 2\nleast = 3\n"));
        assert!(further.contains("unknown key 'least'"), "{further}");
    }
}
