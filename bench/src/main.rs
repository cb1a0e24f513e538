//! The program `dynocar-bench`.

fn main() {}
