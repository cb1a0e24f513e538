//! Estimators that compute for long now and then, and the configuration lines that give others a thread of their own.

use dynocar_shared::PipelineKind;

use super::refusals::{Checker, ConfigError};
use super::{PipelineConfig, ThreadConfig};

/// The name of a thread that is proposed for slow pipelines.
const SLOW: &str = "slow";

/// A slow pipeline may compute for milliseconds: it never shares a thread with a fast one.
pub fn keep_slow_apart(
    checker: &Checker,
    pipelines: &[PipelineConfig],
    threads: &[ThreadConfig],
) -> Result<(), ConfigError> {
    for slow in pipelines.iter().filter(|it| it.is_slow()) {
        let mut others = pipelines.iter().filter(|it| it.thread == slow.thread && !it.is_slow());
        if let Some(fast) = others.next() {
            let key = format!("pipelines.{}.thread", slow.name);
            let name = &threads[slow.thread].name;
            let allowed = format!(
                "a thread without fast pipelines as {}, which {} would hold up; these lines do:\n\n{}",
                fast.name,
                slow.name,
                own_thread(name, pipelines, threads)
            );
            return checker.refuse(key, name, allowed);
        }
    }
    Ok(())
}

/// Returns the message for an unknown thread name, with the expected names.
pub fn names_one(name: &str) -> String {
    let name = toml::Value::from(name);
    format!("the name of a [[threads]] table; these lines make one:\n\n[[threads]]\nname = {name}")
}

/// Returns the lines that give the slow pipelines of a thread one of their own: one that has only such, else a new
/// one.
fn own_thread(shared: &str, pipelines: &[PipelineConfig], threads: &[ThreadConfig]) -> String {
    let on = |index: usize| pipelines.iter().filter(move |pipeline| pipeline.thread == index);
    // A thread that no table names is one pipeline's alone.
    let is_own = |name: &str| pipelines.iter().any(|pipeline| pipeline.name == name);
    let free = threads.iter().enumerate().find(|(index, thread)| {
        on(*index).count() > 0 && on(*index).all(PipelineConfig::is_slow) && !is_own(&thread.name)
    });
    let mut lines = String::new();
    let name = match free {
        Some((_, thread)) => thread.name.clone(),
        None => {
            let is_free = |name: &String| threads.iter().all(|thread| thread.name != *name);
            let mut names =
                std::iter::once(SLOW.to_owned()).chain((2..).map(|n| format!("{SLOW}_{n}")));
            let name = names.find(is_free).unwrap_or_default();
            lines += &format!("[[threads]]\nname = {}\n\n", toml::Value::from(name.as_str()));
            name
        }
    };
    let moved = pipelines.iter().filter(|it| threads[it.thread].name == shared && it.is_slow());
    let moved = moved.map(|it| {
        let own = if it.name == it.estimator.kind().name() {
            String::new()
        } else {
            format!("name = {}\n", toml::Value::from(it.name.as_str()))
        };
        let [kind, thread] = [it.estimator.kind().name(), &name].map(toml::Value::from);
        format!("[[pipelines]]\n{own}kind = {kind}\nthread = {thread}")
    });
    lines + &moved.collect::<Vec<_>>().join("\n\n")
}

impl PipelineConfig {
    fn is_slow(&self) -> bool {
        is_slow(self.estimator.kind())
    }
}

/// Returns true for an estimator whose step may take longer than a fast pipeline may be held up: one that
/// iterates over a whole window or segment. It never shares a thread with a fast one.
pub const fn is_slow(kind: PipelineKind) -> bool {
    matches!(
        kind,
        PipelineKind::TrajectoryNewton
            | PipelineKind::AdhesionEm
            | PipelineKind::BrakeEm
            | PipelineKind::StagedDescent
            | PipelineKind::JointLeastSquares
    )
}

#[cfg(test)]
mod tests {
    use super::super::{ConfigError, DaemonConfig};

    fn load(pipelines: &str) -> Result<DaemonConfig, ConfigError> {
        let folder = tempfile::tempdir().unwrap();
        let train = "[train]\nname = \"t\"\nmass_t = 200.0\nlength_m = 100.0\ncars = 4\n\
                     rotating_mass_factor = 0.06\n[resistance]\na = 1.0\nb = 0.01\nc = 0.001\n";
        std::fs::write(folder.path().join("train.toml"), train).unwrap();
        let path = folder.path().join("daemon.toml");
        let trains = "[[trains]]\nid = 1\nfile = \"train.toml\"\n";
        std::fs::write(&path, format!("{trains}{pipelines}")).unwrap();
        DaemonConfig::load(&path)
    }

    const THREAD: &str = "[[threads]]\nname = \"t\"\npriority = 40\n";

    #[test]
    fn a_slow_pipeline_on_the_thread_of_a_fast_one_is_refused_by_name() {
        let pipelines = "[[pipelines]]\nkind = \"rls\"\nthread = \"t\"\n\
                         [[pipelines]]\nkind = \"trajectory_newton\"\nthread = \"t\"\n";
        let message = load(&format!("{THREAD}{pipelines}")).unwrap_err().to_string();
        let expected = "pipelines.trajectory_newton.thread = t: expected a thread without fast \
                        pipelines as rls";
        assert!(message.contains(expected), "{message}");
        // The lines that are shown do, in the place of those that were refused.
        let (_, lines) = message.split_once("do:\n\n").unwrap();
        assert_eq!(lines.lines().next(), Some("[[threads]]"));
        let fast = "[[pipelines]]\nkind = \"rls\"\nthread = \"t\"\n";
        let config = load(&format!("{THREAD}{fast}{lines}\n")).unwrap();
        let threads: Vec<&str> = config.threads.iter().map(|it| &it.name[..]).collect();
        assert_eq!(threads, ["t", "slow"]);
        // Where a thread of slow pipelines is there, they go on it.
        let slow = "[[threads]]\nname = \"slow\"\n[[pipelines]]\nkind = \"staged_descent\"\nthread = \"slow\"\n";
        let message = load(&format!("{THREAD}{slow}{pipelines}")).unwrap_err().to_string();
        let (_, lines) = message.split_once("do:\n\n").unwrap();
        assert_eq!(lines, "[[pipelines]]\nkind = \"trajectory_newton\"\nthread = \"slow\"");
        load(&format!("{THREAD}{slow}{fast}{lines}\n")).unwrap();
    }

    #[test]
    fn a_thread_that_is_not_there_is_shown_as_lines() {
        let pipelines = "[[pipelines]]\nkind = \"rls\"\nthread = \"x\"\n";
        let message = load(pipelines).unwrap_err().to_string();
        let (_, lines) = message.split_once("make one:\n\n").unwrap();
        load(&format!("{lines}\n{pipelines}")).unwrap();
    }

    #[test]
    fn slow_pipelines_may_share_a_thread_and_one_without_a_thread_gets_its_own() {
        let pipelines = "[[pipelines]]\nkind = \"trajectory_newton\"\nthread = \"t\"\n\
                         [[pipelines]]\nkind = \"staged_descent\"\nthread = \"t\"\n\
                         [[pipelines]]\nkind = \"rls\"\n";
        let config = load(&format!("{THREAD}{pipelines}")).unwrap();
        let threads: Vec<usize> = config.pipelines.iter().map(|it| it.thread).collect();
        assert_eq!(threads, [0, 0, 1]);
        assert_eq!((config.threads[0].priority, config.threads[1].priority), (Some(40), None));
    }

    #[test]
    fn a_priority_out_of_range_is_refused() {
        let thread = "[[threads]]\nname = \"t\"\npriority = 100\n";
        let pipelines = "[[pipelines]]\nkind = \"rls\"\nthread = \"t\"\n";
        let message = load(&format!("{thread}{pipelines}")).unwrap_err().to_string();
        assert!(message.contains("threads.priority = 100: expected a whole number"), "{message}");
    }
}
