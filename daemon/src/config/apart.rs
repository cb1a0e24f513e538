//! Which pipelines may share a thread, and the lines that give others one.

use super::checker::Checker;
use super::{ConfigError, PipelineConfig, ThreadConfig, is_slow};

/// The name of a thread that is proposed for slow pipelines.
const SLOW: &str = "slow";

/// A slow pipeline may compute for milliseconds: it never shares a thread with a fast one.
pub fn keep_slow_apart(
    checker: &Checker,
    pipelines: &[PipelineConfig],
    threads: &[ThreadConfig],
) -> Result<(), ConfigError> {
    let is_slow = |pipeline: &PipelineConfig| is_slow(pipeline.estimator.kind());
    for slow in pipelines.iter().filter(|pipeline| is_slow(pipeline)) {
        let mut others = pipelines.iter().filter(|it| it.thread == slow.thread && !is_slow(it));
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

/// What is expected in the place of the name of no thread.
pub fn names_one(name: &str) -> String {
    let name = toml::Value::from(name);
    format!("the name of a [[threads]] table; these lines make one:\n\n[[threads]]\nname = {name}")
}

/// The lines that give the slow pipelines of a thread one of their own: one that has only such, else a new
/// one.
fn own_thread(shared: &str, pipelines: &[PipelineConfig], threads: &[ThreadConfig]) -> String {
    let is_slow = |pipeline: &PipelineConfig| is_slow(pipeline.estimator.kind());
    let on = |index: usize| pipelines.iter().filter(move |pipeline| pipeline.thread == index);
    // A thread that no table names is one pipeline's alone.
    let is_own = |name: &str| pipelines.iter().any(|pipeline| pipeline.name == name);
    let free = threads.iter().enumerate().find(|(index, thread)| {
        on(*index).count() > 0 && on(*index).all(is_slow) && !is_own(&thread.name)
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
    let moved = pipelines.iter().filter(|it| threads[it.thread].name == shared && is_slow(it));
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
