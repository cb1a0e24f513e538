//! The library's two models as `modelDescription.xml`, by the FMI standard 2.0, and as pages.

use std::fmt::Write as _;

use dynocar_shared::vocabulary::EffectKind;
use dynocar_shared::{Reason, Status};

use super::estimators::{self, ESTIMATORS};
use super::plant::{self, PLANT};
use super::variables;
use super::variables::{Begins, FmiEnumeration, Interface, Kind, MISSING, Meaning, Variable};

const VERSION: &str = env!("CARGO_PKG_VERSION");

/// A step in s that suits every train, used where no recording determines another.
pub const STEP_DEFAULT_S: f64 = 0.1;

/// Returns the text of `modelDescription.xml`, with the step in s that hosts take by default: the same for every FMU of
/// this model in a release.
pub fn model_description(interface: &Interface, step_s: f64) -> String {
    let Interface { identifier, name, about, guid, variables, takes_slopes, .. } = interface;
    let mut xml = format!(
        r#"<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="2.0" modelName="{name}" guid="{guid}" description="{about}"
    version="{VERSION}" license="MIT OR Apache-2.0" generationTool="dynocar {VERSION}"
    variableNamingConvention="structured" numberOfEventIndicators="0">
  <CoSimulation modelIdentifier="{identifier}" canInterpolateInputs="{takes_slopes}"
      canHandleVariableCommunicationStepSize="true" canNotUseMemoryManagementFunctions="true"/>
"#
    );
    push_units(&mut xml);
    if has_vocabularies(interface) {
        push_types(&mut xml);
    }
    xml += "  <LogCategories>\n    <Category name=\"logStatusError\"/>\n  </LogCategories>\n";
    xml += "  <DefaultExperiment startTime=\"0\" stepSize=\"";
    let _ = write!(xml, "{step_s}");
    xml += "\"/>\n  <ModelVariables>\n";
    for (reference, variable) in variables.iter().enumerate() {
        push_variable(&mut xml, reference, variable, *takes_slopes);
    }
    xml += "  </ModelVariables>\n  <ModelStructure>\n";
    if interface.guid == ESTIMATORS.guid {
        // Outputs change by a step alone, and at first depend on the files alone.
        push_unknowns(&mut xml, interface, "Outputs", Some(""));
        let is_file = |variable: &Variable| matches!(variable.meaning, Meaning::File(_));
        let files = indices(interface, is_file).join(" ");
        push_unknowns(&mut xml, interface, "InitialUnknowns", Some(&files));
    } else {
        // Forces hang on any input.
        push_unknowns(&mut xml, interface, "Outputs", None);
        push_unknowns(&mut xml, interface, "InitialUnknowns", None);
    }
    xml + "  </ModelStructure>\n</fmiModelDescription>\n"
}

fn has_vocabularies(interface: &Interface) -> bool {
    interface.variables.iter().any(|it| matches!(it.meaning.kind(), Kind::Enumeration(_)))
}

fn push_units(xml: &mut String) {
    *xml += "  <UnitDefinitions>\n";
    for unit in variables::ALL {
        push(
            xml,
            format_args!("    <Unit name=\"{}\"><BaseUnit {}/></Unit>", unit.name, unit.base),
        );
    }
    *xml += "  </UnitDefinitions>\n";
}

fn push_types(xml: &mut String) {
    *xml += "  <TypeDefinitions>\n";
    for (vocabulary, members) in vocabularies() {
        let name = vocabulary.name();
        push(xml, format_args!("    <SimpleType name=\"{name}\"><Enumeration>"));
        for (name, number) in members {
            push(xml, format_args!("      <Item name=\"{name}\" value=\"{number}\"/>"));
        }
        *xml += "    </Enumeration></SimpleType>\n";
    }
    *xml += "  </TypeDefinitions>\n";
}

/// A vocabulary with the names and numbers of its members.
type Members = (FmiEnumeration, Vec<(&'static str, u32)>);

fn vocabularies() -> [Members; 3] {
    [
        (FmiEnumeration::Status, Status::ALL.iter().map(|it| (it.name(), *it as u32)).collect()),
        (FmiEnumeration::Reason, Reason::ALL.iter().map(|it| (it.name(), *it as u32)).collect()),
        (
            FmiEnumeration::Effect,
            EffectKind::ALL.iter().map(|it| (it.name(), *it as u32)).collect(),
        ),
    ]
}

fn push_variable(xml: &mut String, reference: usize, variable: &Variable, is_continuous: bool) {
    let Variable { name, meaning, unit, description } = variable;
    let nature = match meaning {
        Meaning::Driven(_) => r#"variability="continuous" initial="calculated""#,
        Meaning::File(_) | Meaning::Begins(_) => r#"variability="fixed" initial="exact""#,
        Meaning::Estimate(..) => r#"variability="discrete" initial="calculated""#,
        // An input with a slope is continuous.
        Meaning::Measured(_) if is_continuous => r#"variability="continuous""#,
        _ => r#"variability="discrete""#,
    };
    let causality = meaning.causality();
    push(
        xml,
        format_args!(
            "    <ScalarVariable name=\"{name}\" valueReference=\"{reference}\" \
             causality=\"{causality}\" {nature}\n        description=\"{}\">",
            escaped(description)
        ),
    );
    let mut attributes = String::new();
    if let Kind::Enumeration(vocabulary) = meaning.kind() {
        attributes += &format!(" declaredType=\"{}\"", vocabulary.name());
    }
    if *unit != variables::NONE {
        attributes += &format!(" unit=\"{}\"", unit.name);
    }
    if let Some(start) = start(*meaning) {
        attributes += &format!(" start=\"{start}\"");
    }
    push(xml, format_args!("      <{}{attributes}/>", meaning.kind().name()));
    *xml += "    </ScalarVariable>\n";
}

/// Returns the start value of a variable, unless it is calculated.
fn start(meaning: Meaning) -> Option<String> {
    match meaning {
        Meaning::File(_) => Some(String::new()),
        Meaning::Measured(_) => Some(format!("{MISSING:e}")),
        Meaning::Run | Meaning::Direction => Some("1".into()),
        Meaning::WheelSlide => Some("false".into()),
        Meaning::Begins(Begins::HeldAtRest) => Some("true".into()),
        Meaning::Begins(_) => Some("0".into()),
        Meaning::Estimate(..) | Meaning::Driven(_) => None,
    }
}

/// Returns the indices of variables as the standard counts them, from 1.
fn indices(interface: &Interface, is_wanted: impl Fn(&Variable) -> bool) -> Vec<String> {
    let numbered = interface.variables.iter().zip(1..);
    let wanted = numbered.filter(|(variable, _)| is_wanted(variable));
    wanted.map(|(_, index): (_, u32)| index.to_string()).collect()
}

/// Writes the outputs, with their dependencies where these are less than everything.
fn push_unknowns(xml: &mut String, interface: &Interface, list: &str, on: Option<&str>) {
    let on = on.map(|on| format!(" dependencies=\"{on}\"")).unwrap_or_default();
    push(xml, format_args!("    <{list}>"));
    for index in indices(interface, |variable| variable.meaning.causality() == "output") {
        push(xml, format_args!("      <Unknown index=\"{index}\"{on}/>"));
    }
    push(xml, format_args!("    </{list}>"));
}

/// Returns a page for people: the inputs and outputs of the FMU.
pub fn documentation(interface: &Interface) -> String {
    let Interface { name, about, step, variables, .. } = interface;
    let mut page = format!(
        "<!DOCTYPE html>\n<html lang=\"en\"><meta charset=\"utf-8\"><title>{name}</title>\n\
         <h1>{name} {VERSION}</h1>\n<p>{about}.</p>\n\
         <p>{step} A measured input that is NaN or {MISSING:e} is missing. An output that nobody \
         knows yet is NaN.</p>\n<table>\n\
         <tr><th>variable</th><th>causality</th><th>type</th><th>unit</th><th>meaning</th></tr>\n"
    );
    for Variable { name, meaning, unit, description } in *variables {
        let kind = match meaning.kind() {
            Kind::Enumeration(vocabulary) => vocabulary.name(),
            kind => kind.name(),
        };
        let cells = [*name, meaning.causality(), kind, unit.name, *description];
        page += "<tr>";
        for cell in cells {
            page += &format!("<td>{}</td>", escaped(cell));
        }
        page += "</tr>\n";
    }
    page += "</table>\n";
    let vocabularies = if has_vocabularies(interface) { vocabularies().to_vec() } else { vec![] };
    for (vocabulary, members) in vocabularies {
        page += &format!("<h2>{}</h2>\n<ul>\n", vocabulary.name());
        for (name, number) in members {
            page += &format!("<li>{number}: {name}</li>\n");
        }
        page += "</ul>\n";
    }
    page + "</html>\n"
}

fn push(text: &mut String, line: std::fmt::Arguments<'_>) {
    writeln!(text, "{line}").expect("a text takes any line");
}

/// Returns the text between tags or in double quotes.
fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('"', "&quot;")
}

/// Both models.
pub const INTERFACES: [&Interface; 2] = [&ESTIMATORS, &PLANT];

/// Their GUIDs as a symbol, so that a library shows its own without being loaded.
#[unsafe(no_mangle)]
pub static DYNOCAR_FMU_GUIDS: [[u8; 16]; 2] = [estimators::GUID_DIGITS, plant::GUID_DIGITS];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_description_has_every_variable_under_its_reference() {
        for interface in INTERFACES {
            let xml = model_description(interface, STEP_DEFAULT_S);
            assert_eq!(xml.matches("<ScalarVariable ").count(), interface.variables.len());
            for (reference, Variable { name, .. }) in interface.variables.iter().enumerate() {
                let place = format!("name=\"{name}\" valueReference=\"{reference}\" ");
                assert_eq!(xml.matches(&place).count(), 1, "{name}");
            }
            assert!(xml.contains(interface.guid));
        }
    }

    #[test]
    fn what_starts_with_a_value_is_what_is_set_before_the_first_step() {
        for (interface, measured) in INTERFACES.into_iter().zip([11, 7]) {
            let xml = model_description(interface, STEP_DEFAULT_S);
            let starts = xml.matches(" start=\"").count();
            let is_output = |it: &&Variable| it.meaning.causality() == "output";
            let outputs = interface.variables.iter().filter(is_output).count();
            assert_eq!(starts, interface.variables.len() - outputs);
            assert_eq!(xml.matches(&format!("start=\"{MISSING:e}\"")).count(), measured);
            assert_eq!(xml.matches("<Unknown ").count(), 2 * outputs);
        }
    }

    #[test]
    fn text_in_quotes_stays_text() {
        assert_eq!(escaped("a < b & \"c\""), "a &lt; b &amp; &quot;c&quot;");
        assert!(documentation(&ESTIMATORS).contains("resistance.w0_std"));
    }
}

#[cfg(test)]
mod interfaces_tests {
    use super::*;

    use crate::variables;

    #[test]
    fn names_are_unique_and_units_known() {
        for Interface { variables, .. } in INTERFACES {
            for (reference, variable) in variables.iter().enumerate() {
                assert!(variables[..reference].iter().all(|it| it.name != variable.name));
                assert!(
                    variable.unit == variables::NONE || variables::ALL.contains(&variable.unit)
                );
            }
        }
    }

    #[test]
    fn no_model_is_taken_for_the_other() {
        assert_ne!(ESTIMATORS.guid, PLANT.guid);
        assert_ne!(ESTIMATORS.identifier, PLANT.identifier);
    }
}
