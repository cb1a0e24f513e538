use super::super::origin::{FoundEffect, ModelFigure};
use super::*;
use crate::stamp::UtcSecond;

const TRAIN: &str = "[train]\nmass_t=100\nlength_m=80\nrotating_mass_factor=0.05\n\
    [resistance]\na=1\nb=0\nc=0\n";
const TRACK: &str = "[track]\nname = 'line'\n";

/// Returns a train's models in a directory that is removed after the test.
fn empty() -> (tempfile::TempDir, TrainModels) {
    let directory = tempfile::tempdir().unwrap();
    let models = Store::at(&directory.path().join("models")).train(TrainId(1));
    (directory, models)
}

fn model(a: f64, parent: Option<ModelHash>, unix_s: u64) -> NewModel {
    let parameters = [("c_factor".to_owned(), ModelFigure { value: 2.0, std: 0.1 })].into();
    let effect =
        FoundEffect { kind: "tunnel_drag".into(), intervals_m: vec![[1e3, 2e3]], parameters };
    let origin = Origin {
        made: UtcSecond { unix_s },
        version: "0.1.0".into(),
        command: "dynocar learn".into(),
        parent,
        verdict: Some("effect".into()),
        statement: "A \"quoted\" statement\nof two lines.".into(),
        dataset_sha256: None,
        error: None,
        effects: vec![effect],
        files: Vec::new(),
    };
    let train = TRAIN.replace("a=1", &format!("a={a:?}"));
    NewModel {
        text: ModelText { train, track: Some(TRACK.into()) },
        origin,
        answer_json: Some("{}\n".into()),
        report_html: None,
    }
}

fn decision(what: ModelChoice) -> NewDecision {
    NewDecision { what, by: "Anna".into(), reason: "better".into(), at: UtcSecond { unix_s: 7 } }
}

#[test]
fn a_model_is_read_back_as_it_was_put_and_is_never_written_again() {
    let (_directory, models) = empty();
    assert_eq!(models.list().unwrap(), Listing::default());
    let new = model(1.5, None, 1_763_000_000);
    let hash = models.put(&new).unwrap();
    assert_eq!(hash, new.text.hash());
    let again = NewModel {
        origin: Origin { statement: "another".into(), ..new.origin.clone() },
        ..new.clone()
    };
    assert_eq!(models.put(&again).unwrap(), hash);
    let stored = models.stored(hash).unwrap();
    assert_eq!((stored.origin, models.text(hash).unwrap()), (new.origin, new.text));
    let (train, track) = models.load(hash).unwrap();
    assert_eq!((train.resistance.a, track.is_some()), (1.5, true));
    let names = names_in(&stored.folder).unwrap();
    assert_eq!(names, ["answer.json", "origin.toml", "track.toml", "train.toml"]);
    assert_eq!(Store::at(models.folder().parent().unwrap()).trains().unwrap(), [TrainId(1)]);
}

#[test]
fn what_is_changed_half_written_or_foreign_is_named_and_not_used() {
    let (_directory, models) = empty();
    let hashes = [1.0, 2.0, 3.0].map(|a| models.put(&model(a, None, a as u64)).unwrap());
    let [changed, torn, whole] = hashes;
    std::fs::write(models.folder_of(changed).join(TRAIN_FILE), TRAIN).unwrap();
    std::fs::remove_file(models.folder_of(torn).join(ORIGIN_FILE)).unwrap();
    std::fs::create_dir(models.folder().join(".0123456789abcdef.77.part")).unwrap();
    std::fs::write(models.folder().join("notes.txt"), "mine").unwrap();
    let listing = models.list().unwrap();
    assert_eq!(listing.models.iter().map(|it| it.hash).collect::<Vec<_>>(), [whole]);
    assert_eq!(listing.left_out.len(), 4, "{:?}", listing.left_out);
    assert!(matches!(models.load(changed), Err(ModelsError::Changed { .. })));
    assert!(matches!(models.put(&model(1.0, None, 1)), Err(ModelsError::Changed { .. })));
    let missing = ModelHash(5);
    assert!(matches!(models.load(missing), Err(ModelsError::NoModel { .. })));
    let refused = models.decide(&decision(ModelChoice::Adopt(changed))).unwrap_err().to_string();
    assert!(refused.contains("changed after it was put into the store"), "{refused}");
}

#[test]
fn decisions_say_what_is_in_force_and_rollbacks_go_back_one_by_one() {
    let (_directory, models) = empty();
    let declared = models.put(&model(0.5, None, 1)).unwrap();
    let [a, b] = [1.0, 2.0].map(|it| models.put(&model(it, Some(declared), it as u64)).unwrap());
    let c = models.put(&model(3.0, Some(a), 3)).unwrap();
    let decide = |what| models.decide(&decision(what));
    assert_eq!(models.in_force().unwrap(), None);
    assert_eq!(models.candidates(declared).unwrap(), [b, a], "the newest first");
    assert!(matches!(decide(ModelChoice::RollBack), Err(ModelsError::NothingAdopted { .. })));
    assert_eq!(decide(ModelChoice::Adopt(a)).unwrap(), 1);
    assert!(matches!(decide(ModelChoice::Adopt(a)), Err(ModelsError::InForce { .. })));
    assert!(matches!(decide(ModelChoice::Adopt(ModelHash(9))), Err(ModelsError::NoModel { .. })));
    assert_eq!(models.candidates(a).unwrap(), [c]);
    assert_eq!(decide(ModelChoice::Adopt(c)).unwrap(), 2);
    assert_eq!(decide(ModelChoice::RollBack).unwrap(), 3);
    assert_eq!(models.in_force().unwrap(), Some(a));
    assert!(models.candidates(a).unwrap().is_empty(), "what was taken back is none");
    assert_eq!(decide(ModelChoice::RollBack).unwrap(), 4);
    assert_eq!(models.in_force().unwrap(), None);
    assert_eq!(models.candidates(declared).unwrap(), [b]);
    decide(ModelChoice::Reject(b)).unwrap();
    assert!(models.candidates(declared).unwrap().is_empty());
    let last = models.decisions().unwrap().pop().unwrap();
    assert_eq!((last.0, last.1.action, last.1.by.as_str()), (5, Action::Rejected, "Anna"));
    let nobody = NewDecision { by: " ".into(), ..decision(ModelChoice::Adopt(b)) };
    assert!(matches!(models.decide(&nobody), Err(ModelsError::NoName)));
}

#[test]
fn writers_at_the_same_time_take_numbers_of_their_own_and_make_a_model_once() {
    let (_directory, models) = empty();
    let hashes = [1.0, 2.0].map(|a| models.put(&model(a, None, 1)).unwrap());
    let new = model(9.0, None, 1);
    std::thread::scope(|scope| {
        for thread in 0..4 {
            let (models, new) = (&models, &new);
            scope.spawn(move || {
                models.put(new).unwrap();
                for _ in 0..5 {
                    // Half of them find that the other already decided so.
                    let _ = models.decide(&decision(ModelChoice::Adopt(hashes[thread % 2])));
                    models.decide(&decision(ModelChoice::Reject(new.text.hash()))).unwrap();
                }
            });
        }
    });
    let decisions = models.decisions().unwrap();
    let numbers: Vec<u64> = decisions.iter().map(|(number, _)| *number).collect();
    assert_eq!(numbers, (1..=numbers.len() as u64).collect::<Vec<_>>());
    let rejected = decisions.iter().filter(|(_, it)| it.action == Action::Rejected).count();
    assert_eq!(rejected, 20, "each was written by one");
    let adopted = decisions.iter().filter(|(_, it)| it.action == Action::Adopted);
    let adopted: Vec<_> = adopted.map(|(_, it)| (it.from, it.model)).collect();
    assert!(adopted.windows(2).all(|pair| pair[0].1 == pair[1].0), "one history: {adopted:?}");
    assert!(models.list().unwrap().left_out.is_empty());
}

#[test]
fn a_decision_that_cannot_be_read_is_no_other_history() {
    let (_directory, models) = empty();
    let hash = models.put(&model(1.0, None, 1)).unwrap();
    models.decide(&decision(ModelChoice::Adopt(hash))).unwrap();
    let path = records::path_of(&models.folder().join(DECISIONS), 1);
    std::fs::write(&path, "action = 'adopted'\nby = 3\n").unwrap();
    let message = models.in_force().unwrap_err().to_string();
    assert!(message.starts_with(&format!("{}: no record", path.display())), "{message}");
    assert!(!message.contains('\n'), "{message}");
}
