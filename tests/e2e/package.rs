//! The Debian package, built as its page says and installed into an empty root; its completions and manual pages.

use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use dynocar_tests::process::DaemonSite;

use crate::commands::{DYNOCAR, done, dynocar, said};
use crate::support::{compiler, library_directory, must_succeed, require};

/// Files that the package must hold, for the tested programs.
const FILES: [&str; 20] = [
    "usr/bin/dynocar",
    "usr/bin/dynocar-workshop",
    "usr/lib/systemd/system/dynocar.service",
    "usr/lib/sysusers.d/dynocar.conf",
    "usr/include/dynocar.h",
    "usr/include/dynocar.hpp",
    "usr/lib/libdynocar_client.a",
    "usr/lib/libdynocar_client.so",
    "usr/lib/pkgconfig/dynocar-client.pc",
    "usr/lib/cmake/dynocar/dynocar-config.cmake",
    "usr/lib/cmake/dynocar/dynocar-config-version.cmake",
    "usr/lib/dynocar/libdynocar_fmu.so",
    "usr/share/bash-completion/completions/dynocar",
    "usr/share/zsh/vendor-completions/_dynocar",
    "usr/share/fish/vendor_completions.d/dynocar.fish",
    "usr/share/man/man1/dynocar.1.gz",
    "usr/share/man/man1/dynocar-init.1.gz",
    "usr/share/doc/dynocar/copyright",
    "etc/dynocar/daemon.toml",
    "etc/dynocar/train.toml",
];

fn build(out: &Path) -> Output {
    require("dpkg-deb", "dpkg");
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("../config/debian/build.sh");
    let mut command = Command::new(script);
    command.args(["--program", DYNOCAR, "--libraries"]).arg(library_directory());
    command.arg("--out").arg(out).output().unwrap()
}

/// The package in a folder.
fn package(folder: &Path) -> PathBuf {
    let output = build(folder);
    let words = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{words}");
    let path = PathBuf::from(String::from_utf8(output.stdout).unwrap().trim());
    let name = path.file_name().unwrap().to_str().unwrap().to_owned();
    let arch = must_succeed(Command::new("dpkg").arg("--print-architecture"));
    assert_eq!(name, format!("dynocar_{}_{}.deb", env!("CARGO_PKG_VERSION"), arch.trim()));
    path
}

/// Puts the package into a root: by dpkg, with its scripts, where the test may; else unpacked.
fn install(package: &Path, root: &Path) -> bool {
    let state = root.join("var/lib/dpkg");
    std::fs::create_dir_all(state.join("info")).unwrap();
    std::fs::create_dir_all(state.join("updates")).unwrap();
    std::fs::write(state.join("status"), "").unwrap();
    if !rustix::process::geteuid().is_root() {
        must_succeed(Command::new("dpkg-deb").arg("-x").arg(package).arg(root));
        return false;
    }
    let mut dpkg = Command::new("dpkg");
    dpkg.arg(format!("--root={}", root.display()));
    // The root is empty: neither a C library to depend on nor a shell to change into it with.
    dpkg.args(["--force-depends", "--force-script-chrootless", "--install"]).arg(package);
    must_succeed(&mut dpkg);
    true
}

#[test]
fn the_package_is_built_installed_and_runs() {
    let folder = tempfile::tempdir().unwrap();
    let package = package(folder.path());
    let root = folder.path().join("root");
    let by_dpkg = install(&package, &root);
    for file in FILES {
        assert!(root.join(file).is_file(), "{file}");
    }
    let field =
        |name: &str| must_succeed(Command::new("dpkg-deb").arg("--field").arg(&package).arg(name));
    assert!(field("Depends").starts_with("libc6 (>= 2."), "{}", field("Depends"));
    if by_dpkg {
        let mut query = Command::new("dpkg-query");
        query.arg(format!("--admindir={}", root.join("var/lib/dpkg").display()));
        query.args(["--showformat", "${Status}\n${Conffiles}\n", "--show", "dynocar"]);
        let printed = must_succeed(&mut query);
        assert!(printed.starts_with("install ok installed\n"), "{printed}");
        for file in ["/etc/dynocar/daemon.toml ", "/etc/dynocar/train.toml "] {
            assert!(printed.contains(file), "{printed}");
        }
    }
    let program = root.join("usr/bin/dynocar");
    let version = must_succeed(Command::new(&program).arg("--version"));
    assert_eq!(version.trim(), concat!("dynocar ", env!("CARGO_PKG_VERSION")));
    for file in ["daemon.toml", "train.toml"] {
        must_succeed(Command::new(&program).arg("check").arg(root.join("etc/dynocar").join(file)));
    }
    let fmu = folder.path().join("dynocar.fmu");
    must_succeed(Command::new(&program).arg("fmu").arg("-o").arg(&fmu));
    assert!(fmu.is_file(), "the library is found where the package puts it");
    let unit =
        std::fs::read_to_string(root.join("usr/lib/systemd/system/dynocar.service")).unwrap();
    let keys: HashMap<&str, &str> = unit.lines().filter_map(|line| line.split_once('=')).collect();
    assert_eq!(keys["ExecStart"], "/usr/bin/dynocar run --config /etc/dynocar/daemon.toml");
    links_and_runs(&root, folder.path());
}

/// Builds programs in C and C++ from the files of the package alone: with the archive, and with the shared library that
/// pkg-config names.
fn links_and_runs(root: &Path, folder: &Path) {
    let (source, out) = (folder.join("version.c"), folder.join("version"));
    let text = "#include <dynocar.h>\n#include <stdio.h>\n\
                int main(void) { return puts(dynocar_version()) < 0; }\n";
    std::fs::write(&source, text).unwrap();
    let library = root.join("usr/lib");
    let built = |options: &[String]| {
        let standard = compiler("CC", "cc", "c99");
        let mut command = Command::new(standard.get_program());
        command.arg("-std=c99").arg(&source).args(options).arg("-o").arg(&out);
        must_succeed(&mut command);
        let mut program = Command::new(&out);
        let version = must_succeed(program.env("LD_LIBRARY_PATH", &library));
        assert_eq!(version.trim(), env!("CARGO_PKG_VERSION"), "{options:?}");
    };
    let archive = [format!("-I{}", root.join("usr/include").display())].into_iter();
    let archive = archive.chain([library.join("libdynocar_client.a").display().to_string()]);
    built(&archive.chain(["-lpthread", "-ldl", "-lm"].map(String::from)).collect::<Vec<_>>());

    require("pkg-config", "pkg-config");
    let mut asked = Command::new("pkg-config");
    asked.env("PKG_CONFIG_PATH", library.join("pkgconfig"));
    let printed = must_succeed(asked.args(["--cflags", "--libs", "dynocar-client"]));
    built(&printed.split_whitespace().map(String::from).collect::<Vec<_>>());
    let (source, words) = (folder.join("absent.cpp"), printed.split_whitespace());
    let text = "#include <dynocar.hpp>\n\
                int main() { return dynocar::daemon_state(1, \"/nowhere\").state; }\n";
    std::fs::write(&source, text).unwrap();
    require("c++", "g++");
    let cpp = folder.join("absent");
    must_succeed(
        Command::new("c++").arg("-std=c++17").arg(&source).args(words).arg("-o").arg(&cpp),
    );
    must_succeed(Command::new(&cpp).env("LD_LIBRARY_PATH", &library));
    let needed = must_succeed(Command::new("ldd").arg(&out).env("LD_LIBRARY_PATH", &library));
    let (major, minor) = (env!("CARGO_PKG_VERSION_MAJOR"), env!("CARGO_PKG_VERSION_MINOR"));
    assert!(needed.contains(&format!("libdynocar_client.so.{major}.{minor} => ")), "{needed}");
}

#[test]
fn a_package_without_its_parts_is_refused_in_words() {
    let folder = tempfile::tempdir().unwrap();
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("../config/debian/build.sh");
    let refusal = |arguments: &[&str]| {
        let output = Command::new(&script).args(arguments).output().unwrap();
        assert!(!output.status.success(), "{arguments:?}");
        String::from_utf8(output.stderr).unwrap()
    };
    let nowhere = folder.path().join("nowhere").display().to_string();
    let message = refusal(&["--program", &nowhere]);
    assert!(message.contains("nowhere: no such file; build it with cargo"), "{message}");
    assert!(refusal(&["--colour", "red"]).contains("expected --program, --libraries or --out"));
    assert!(refusal(&["--out"]).contains("--out: expected a value"));
}

#[test]
fn completions_and_manual_list_every_command() {
    let site = DaemonSite::new();
    let help = done(&site, &["--help"]);
    let commands: Vec<&str> = help
        .lines()
        .take_while(|line| *line != "Options:")
        .filter_map(|line| line.strip_prefix("  ")?.split(' ').next())
        .collect();
    assert!(commands.len() > 10 && commands.contains(&"init"), "{help}");
    for shell in ["bash", "zsh", "fish", "elvish", "powershell"] {
        let script = done(&site, &["completions", shell]);
        for name in &commands {
            assert!(script.contains(name), "{shell}: {name}");
        }
    }
    site.write("dynocar.bash", &done(&site, &["completions", "bash"]));
    let words = "source dynocar.bash && complete -p dynocar";
    let bash = Command::new("bash").args(["-c", words]).current_dir(site.path()).output().unwrap();
    assert!(bash.status.success(), "{}", said(&bash));
    assert_eq!(dynocar(&site, &["completions", "tcsh"]).status.code(), Some(2));
    done(&site, &["man", "--out", "man"]);
    let pages = std::fs::read_dir(site.path().join("man")).unwrap().count();
    assert_eq!(pages, commands.len() + 1);
    for name in commands {
        let page =
            std::fs::read_to_string(site.path().join(format!("man/dynocar-{name}.1"))).unwrap();
        assert!(page.contains(".SH NAME") && page.contains(".SH OPTIONS"), "{name}: {page}");
    }
}
