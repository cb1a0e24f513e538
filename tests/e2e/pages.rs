//! Recognition of links, headings, paragraphs and commands on a page.

use dynocar_tests::documents::Page;

fn page(text: &str) -> Page {
    Page { path: "docs/page.md".into(), text: text.to_owned() }
}

/// The commands of a program on a page, each as its words.
fn found(page: &Page, program: &str) -> Vec<Vec<String>> {
    page.commands(program).into_iter().map(|it| it.words).collect()
}

#[test]
fn words_are_a_shells_up_to_what_is_no_argument() {
    let page = page("```sh\na --by 'A. B' c=\"\" # more\na b > c\na b &\n```\n");
    let words = found(&page, "a");
    assert_eq!(words[0], ["--by", "A. B", "c="]);
    assert_eq!(words[1..], [["b"], ["b"]]);
}

#[test]
fn commands_are_found_in_blocks_sessions_and_sentences() {
    let text = "Say `dynocar check PATH`, not `dynocar`.\n```sh\ncargo run --release -- demo\ndynocar run \\\n  --config x\n```\n\
                ```text\n$ dynocar health\ndynocar never\n```\n";
    let words: Vec<String> =
        found(&page(text), "dynocar").iter().map(|words| words.join(" ")).collect();
    assert_eq!(words, ["check PATH", "demo", "run --config x", "health"]);
    let bench = page("```sh\ncargo run --release -p dynocar-bench -- papers\n```\n");
    assert!(found(&bench, "dynocar").is_empty());
    assert_eq!(found(&bench, "dynocar-bench"), [["papers"]]);
}

#[test]
fn anchors_are_those_of_github() {
    let page =
        page("# What runs add: `[corrections]`, `masses`\n# A\n```\n# no heading\n```\n## B c\n");
    assert_eq!(page.anchors(), ["what-runs-add-corrections-masses", "a", "b-c"]);
}

#[test]
fn links_in_code_are_none_and_paragraphs_end_at_lists_and_tables() {
    let page = page("See [a](b.md#c).\n```\n[x](y)\n```\nOne\ntwo\n- three\n\n| four |\n");
    assert_eq!(page.links(), ["b.md#c"]);
    assert_eq!(page.paragraphs(), [" See [a](b.md#c).", " One two", " - three"]);
}
