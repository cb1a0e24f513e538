//! The table of variables as `modelDescription.xml`, by the FMI standard 2.0, and as a page.

use std::fmt::Write as _;

use dynocar_shared::vocabulary::EffectKind;
use dynocar_shared::{Reason, Status};

use crate::MODEL_IDENTIFIER;
use crate::units;
use crate::variables::{GUID, Kind, MISSING, Meaning, VARIABLES, Variable, Vocabulary};

const VERSION: &str = env!("CARGO_PKG_VERSION");
const ABOUT: &str = "Learns running resistance, mass, adhesion and brake friction of a train from \
    what its controller measures";

/// The text of `modelDescription.xml`: the same for every FMU of a release.
pub fn model_description() -> String {
    let mut xml = format!(
        r#"<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="2.0" modelName="Dynocar" guid="{GUID}" description="{ABOUT}"
    version="{VERSION}" license="MIT OR Apache-2.0" generationTool="dynocar {VERSION}"
    variableNamingConvention="structured" numberOfEventIndicators="0">
  <CoSimulation modelIdentifier="{MODEL_IDENTIFIER}"
      canHandleVariableCommunicationStepSize="true" canNotUseMemoryManagementFunctions="true"/>
"#
    );
    push_units(&mut xml);
    push_types(&mut xml);
    xml += "  <LogCategories>\n    <Category name=\"logStatusError\"/>\n  </LogCategories>\n";
    xml += "  <DefaultExperiment startTime=\"0\" stepSize=\"0.1\"/>\n  <ModelVariables>\n";
    for (reference, variable) in VARIABLES.iter().enumerate() {
        push_variable(&mut xml, reference, variable);
    }
    xml += "  </ModelVariables>\n  <ModelStructure>\n";
    // What is got changes by a step alone, and at first hangs on the files alone.
    push_unknowns(&mut xml, "Outputs", "");
    let is_file = |variable: &Variable| matches!(variable.meaning, Meaning::File(_));
    push_unknowns(&mut xml, "InitialUnknowns", &indices(is_file).join(" "));
    xml + "  </ModelStructure>\n</fmiModelDescription>\n"
}

fn push_units(xml: &mut String) {
    *xml += "  <UnitDefinitions>\n";
    for unit in units::ALL {
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
type Members = (Vocabulary, Vec<(&'static str, u32)>);

fn vocabularies() -> [Members; 3] {
    [
        (Vocabulary::Status, Status::ALL.iter().map(|it| (it.name(), *it as u32)).collect()),
        (Vocabulary::Reason, Reason::ALL.iter().map(|it| (it.name(), *it as u32)).collect()),
        (Vocabulary::Effect, EffectKind::ALL.iter().map(|it| (it.name(), *it as u32)).collect()),
    ]
}

fn push_variable(xml: &mut String, reference: usize, variable: &Variable) {
    let Variable { name, meaning, unit, description } = variable;
    let nature = match meaning {
        Meaning::File(_) => r#"variability="fixed" initial="exact""#,
        Meaning::Estimate(..) => r#"variability="discrete" initial="calculated""#,
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
    if *unit != units::NONE {
        attributes += &format!(" unit=\"{}\"", unit.name);
    }
    if let Some(start) = start(*meaning) {
        attributes += &format!(" start=\"{start}\"");
    }
    push(xml, format_args!("      <{}{attributes}/>", meaning.kind().name()));
    *xml += "    </ScalarVariable>\n";
}

/// What a variable starts with, unless it is calculated.
fn start(meaning: Meaning) -> Option<String> {
    match meaning {
        Meaning::File(_) => Some(String::new()),
        Meaning::Measured(_) => Some(format!("{MISSING:e}")),
        Meaning::Run | Meaning::Direction => Some("1".into()),
        Meaning::WheelSlide => Some("false".into()),
        Meaning::Estimate(..) => None,
    }
}

/// Indices of variables as the standard counts them, from 1.
fn indices(is_wanted: impl Fn(&Variable) -> bool) -> Vec<String> {
    let numbered = VARIABLES.iter().zip(1..).filter(|(variable, _)| is_wanted(variable));
    numbered.map(|(_, index): (_, u32)| index.to_string()).collect()
}

fn push_unknowns(xml: &mut String, list: &str, dependencies: &str) {
    push(xml, format_args!("    <{list}>"));
    for index in indices(|variable| matches!(variable.meaning, Meaning::Estimate(..))) {
        push(
            xml,
            format_args!("      <Unknown index=\"{index}\" dependencies=\"{dependencies}\"/>"),
        );
    }
    push(xml, format_args!("    </{list}>"));
}

/// A page for people: what the FMU takes and gives.
pub fn documentation() -> String {
    let mut page = format!(
        "<!DOCTYPE html>\n<html lang=\"en\"><meta charset=\"utf-8\"><title>Dynocar</title>\n\
         <h1>Dynocar {VERSION}</h1>\n<p>{ABOUT}.</p>\n\
         <p>Each step takes one sample: the inputs at the beginning of the step, stamped with its \
         time. A measured input that is NaN or {MISSING:e} is missing. An output that nobody knows \
         yet is NaN; use an estimate only while its status is 2, estimated.</p>\n<table>\n\
         <tr><th>variable</th><th>causality</th><th>type</th><th>unit</th><th>meaning</th></tr>\n"
    );
    for Variable { name, meaning, unit, description } in VARIABLES {
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
    for (vocabulary, members) in vocabularies() {
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

/// Text between tags or in double quotes.
fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('"', "&quot;")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_description_has_every_variable_under_its_reference() {
        let xml = model_description();
        assert_eq!(xml.matches("<ScalarVariable ").count(), VARIABLES.len());
        for (reference, Variable { name, .. }) in VARIABLES.iter().enumerate() {
            let place = format!("name=\"{name}\" valueReference=\"{reference}\" ");
            assert_eq!(xml.matches(&place).count(), 1, "{name}");
        }
        assert!(xml.contains(GUID));
    }

    #[test]
    fn what_starts_with_a_value_is_what_is_set_before_the_first_step() {
        let xml = model_description();
        let starts = xml.matches(" start=\"").count();
        let outputs = VARIABLES.iter().filter(|it| it.meaning.causality() == "output").count();
        assert_eq!(starts, VARIABLES.len() - outputs);
        assert_eq!(xml.matches(&format!("start=\"{MISSING:e}\"")).count(), 11);
        assert_eq!(xml.matches("<Unknown ").count(), 2 * outputs);
    }

    #[test]
    fn text_in_quotes_stays_text() {
        assert_eq!(escaped("a < b & \"c\""), "a &lt; b &amp; &quot;c&quot;");
        assert!(documentation().contains("resistance.w0_std"));
    }
}
