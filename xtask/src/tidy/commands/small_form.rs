//! Maps a documented command line to one that runs in seconds: generated scenes, tiny pictures, one sample.

/// What becomes of a command line.
#[derive(Debug, PartialEq, Eq)]
pub(super) enum Form {
    /// It runs in this form.
    Small(SmallForm),
    /// `.ci/run` has a step that starts with this and covers it.
    StepOfChecks(&'static str),
    /// It does not run, for this reason.
    NotRun(&'static str),
}

/// Arguments of cargo that run in a folder of generated scenes; see `inputs`.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct SmallForm {
    pub(super) arguments: Vec<String>,
    /// The command fails without this program or library.
    pub(super) needs: Option<Tool>,
}

/// What a machine may lack.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Tool {
    /// Embree, which `--peers` needs, too.
    Embree,
    Valgrind,
}

/// Command lines that start like this have no small form.
const EXCEPTIONS: &[(&str, Form)] = &[
    (
        "cargo test --workspace",
        Form::StepOfChecks("cargo test --workspace"),
    ),
    ("cargo clippy", Form::StepOfChecks("cargo clippy")),
    ("cargo xtask tidy", Form::StepOfChecks("cargo xtask tidy")),
    (
        "cargo +nightly",
        Form::NotRun("needs a nightly toolchain, which the checks do not install"),
    ),
    (
        "cargo fuzz",
        Form::NotRun("needs a nightly toolchain, which the checks do not install"),
    ),
    (
        "cargo add",
        Form::NotRun("changes the manifest of the user's crate"),
    ),
    ("cargo publish", Form::NotRun("uploads to a registry")),
];

/// Where generated scenes are, in the folder in which small forms run.
pub(super) const SCENES: &str = "scenes";
/// The scene that stands for a whole folder of scenes.
const SCENE: &str = "small";
/// Where runs of `bench` are recorded, and the one that `report` and `compare` read.
const RUNS: &str = "runs";
const LATEST_RUN: &str = "runs/latest";

/// The form in which a command line runs; fails if no rule knows the command.
pub(super) fn form_of(line: &str) -> Result<Form, String> {
    let is_start = |start: &str| {
        let rest = line.strip_prefix(start);
        rest.is_some_and(|rest| rest.is_empty() || rest.starts_with(' '))
    };
    if let Some((_, form)) = EXCEPTIONS.iter().find(|(start, _)| is_start(start)) {
        return Ok(form.copied());
    }
    let words: Vec<&str> = line.split_whitespace().collect();
    match words.as_slice() {
        ["cargo", "xtask", name, rest @ ..] => of_xtask(name, rest),
        ["cargo", "run", rest @ ..] => of_run(rest),
        ["cargo", "doc", rest @ ..] => Ok(small(of_doc(rest))),
        ["cargo", "bench", ..] => Ok(small(of_bench())),
        ["cargo", "test", rest @ ..] => of_test(rest),
        ["cargo", name @ ("build" | "check"), rest @ ..]
            if rest.iter().any(|word| ["-p", "--package"].contains(word)) =>
        {
            Ok(small(owned(&[&[*name], rest].concat())))
        }
        _ => Err("`cargo xtask tidy` knows no small form of it".into()),
    }
}

/// The record that `report` and `compare` read.
pub(super) fn recorded_run() -> SmallForm {
    let arguments = ["xtask", "bench", "--samples", "1", "--smoke", "--out", RUNS];
    SmallForm {
        arguments: owned(&arguments),
        needs: None,
    }
}

impl SmallForm {
    /// Whether it reads [`recorded_run`].
    pub(super) fn needs_recorded_run(&self) -> bool {
        self.arguments.iter().any(|word| word == LATEST_RUN)
    }

    /// The form for a machine on which some tools are installed: none without the tool that it needs, no `--peers` without Embree.
    pub(super) fn with_tools(&self, is_installed: &dyn Fn(Tool) -> bool) -> Option<Self> {
        let mut form = self.clone();
        if !is_installed(Tool::Embree) {
            form.arguments.retain(|word| word != "--peers");
        }
        self.needs.is_none_or(is_installed).then_some(form)
    }

    /// The values of an option that takes a list.
    pub(super) fn values(&self, option: &str) -> Vec<&str> {
        let pairs = self.arguments.windows(2);
        pairs
            .filter(|pair| pair[0] == option)
            .flat_map(|pair| pair[1].split(','))
            .collect()
    }
}

impl Form {
    const fn copied(&self) -> Self {
        match self {
            Self::StepOfChecks(step) => Self::StepOfChecks(step),
            Self::NotRun(reason) => Self::NotRun(reason),
            Self::Small(_) => panic!("an exception has no small form"),
        }
    }
}

fn small(arguments: Vec<String>) -> Form {
    Form::Small(SmallForm {
        arguments,
        needs: None,
    })
}

fn owned(words: &[&str]) -> Vec<String> {
    words.iter().map(|word| (*word).to_owned()).collect()
}

/// Documentation of one crate, without a browser.
fn of_doc(rest: &[&str]) -> Vec<String> {
    let kept = rest.iter().copied().filter(|word| *word != "--open");
    owned(
        &["doc"]
            .into_iter()
            .chain(kept)
            .chain(["--no-deps"])
            .collect::<Vec<_>>(),
    )
}

/// The features with which `.ci/run` tests the workspace: with others, and with a part of the workspace, dependencies compile again.
const TEST_FEATURES: &str = "kd-oracle/long-tests,kd/serde";

/// A test by its name, in the build of the whole workspace. All tests of a crate are among those that `.ci/run` runs.
fn of_test(rest: &[&str]) -> Result<Form, String> {
    let name = rest.iter().skip_while(|word| **word != "--test").nth(1);
    let end = rest.iter().position(|word| *word == "--");
    let arguments = &rest[end.unwrap_or(rest.len())..];
    match name {
        Some(name) => {
            let call = [
                "test",
                "--workspace",
                "--features",
                TEST_FEATURES,
                "--test",
                name,
            ];
            Ok(small(owned(&[&call, arguments].concat())))
        }
        None if rest.contains(&"-p") => Ok(Form::StepOfChecks("cargo test --workspace")),
        None => Err("`cargo xtask tidy` knows tests of one crate and of the workspace".into()),
    }
}

/// Each benchmark of criterion once, as a test, in the build of the whole workspace.
fn of_bench() -> Vec<String> {
    let features = format!("{TEST_FEATURES},kd-bench/kernels");
    owned(&[
        "test",
        "--workspace",
        "--features",
        &features,
        "--bench",
        "*",
    ])
}

/// `cargo run` of an example or of the command line program.
fn of_run(rest: &[&str]) -> Result<Form, String> {
    let end = rest.iter().position(|word| *word == "--");
    let (flags, arguments) = rest.split_at(end.unwrap_or(rest.len()));
    let arguments = arguments.get(1..).unwrap_or_default();
    let flags = flags.iter().copied().filter(|flag| *flag != "--release");
    let flags: Vec<&str> = flags.collect();
    let is_program = flags.contains(&"kd-cli");
    if !is_program && !flags.contains(&"--example") {
        return Err("`cargo xtask tidy` knows small forms of kd-cli and of examples".into());
    }
    let mut call = vec!["run".to_owned(), "--quiet".to_owned()];
    call.extend(owned(&flags));
    call.push("--".into());
    call.extend(if is_program {
        of_program(arguments)
    } else {
        owned(arguments)
    });
    Ok(small(call))
}

/// `kd COMMAND`: two frames of small pictures of the smallest scene of its kind.
fn of_program(arguments: &[&str]) -> Vec<String> {
    let mut call = Vec::new();
    let mut words = arguments.iter().copied().peekable();
    while let Some(word) = words.next() {
        let value = match word {
            "--frames" => Some("0..2"),
            "--size" => Some("32x24"),
            _ => None,
        };
        match (value, word.split_once(':')) {
            (Some(value), _) => {
                call.extend(owned(&[word, value]));
                words.next();
            }
            (None, Some((family, size))) if size.parse::<u32>().is_ok() => {
                call.push(format!("{family}:1"));
            }
            _ => call.push(word.to_owned()),
        }
    }
    if arguments.first() == Some(&"render") && !arguments.contains(&"--size") {
        call.extend(owned(&["--size", "32x24"]));
    }
    call
}

/// What a command of `cargo xtask` accepts.
struct Options {
    name: &'static str,
    /// `--smoke`: tiny scenes and few rays.
    smoke: bool,
    samples: bool,
    /// `--out`: the folder of the run.
    out: bool,
    needs: Option<Tool>,
}

const fn options(
    name: &'static str,
    [smoke, samples, out]: [bool; 3],
    needs: Option<Tool>,
) -> Options {
    Options {
        name,
        smoke,
        samples,
        out,
        needs,
    }
}

const XTASK: [Options; 17] = [
    options("bench", [true, true, true], None),
    options("builds", [true, true, true], Some(Tool::Embree)),
    options("files", [true, true, false], None),
    options("first-ray", [true, true, true], Some(Tool::Embree)),
    options("saved", [true, true, false], None),
    options("rays", [true, true, true], Some(Tool::Embree)),
    options("queries", [true, true, false], None),
    options("merges", [true, true, false], None),
    options("points", [true, true, false], None),
    options("structures", [true, true, true], Some(Tool::Embree)),
    options("spheres", [true, true, false], Some(Tool::Embree)),
    options("paper", [true, true, false], None),
    options("instructions", [false, false, false], Some(Tool::Valgrind)),
    options("report", [false, false, false], None),
    options("calibrate", [true, true, false], None),
    options("compare", [false, false, false], None),
    options("results", [false, false, false], None),
];

fn of_xtask(name: &str, rest: &[&str]) -> Result<Form, String> {
    let Some(options) = XTASK.iter().find(|options| options.name == name) else {
        return Err(format!("`cargo xtask` has no command `{name}`"));
    };
    let is_merge_table = rest.contains(&"merge-table");
    let has_folder = rest.contains(&"--scenes");
    let is_help = rest.contains(&"--help");
    // A smoke of the merge table generates its scene; to read one takes a run that is none.
    let is_smoke = options.smoke && !(is_merge_table && has_folder);
    let mut call = owned(&["xtask", name]);
    let mut words = rest.iter().copied();
    while let Some(word) = words.next() {
        let value = match word {
            "--scenes" => Some(SCENES),
            "--samples" => Some("1"),
            "--json" => Some("record.jsonl"),
            "--calibration" => Some("calibration.json"),
            "--plot" => Some("plot.svg"),
            "--picture" => Some("picture.png"),
            "--out" => Some(RUNS),
            _ => None,
        };
        if let Some(value) = value {
            call.extend(owned(&[word, value]));
            words.next();
        } else if word.starts_with("--growth") && (name == "builds" || name == "first-ray") {
            call.push("--growth=20000".into());
        } else if word == "--scene" && (rest.contains(&"grid-table") || name == "instructions") {
            // The smoke of one has scenes of its own; to count in one scene takes a minute.
            words.next();
        } else if name == "report" || name == "compare" {
            call.push(LATEST_RUN.into());
        } else {
            call.push(if word == "TABLE" { "merge-table" } else { word }.into());
        }
    }
    let has = |call: &[String], word: &str| call.iter().any(|one| one == word);
    if has_folder && !has(&call, "--scene") && !rest.contains(&"grid-table") {
        call.extend(owned(&["--scene", SCENE]));
    }
    if options.samples && !has(&call, "--samples") && !is_help {
        call.extend(owned(&["--samples", "1"]));
    }
    if is_smoke && !has(&call, "--smoke") {
        call.push("--smoke".into());
    }
    if is_merge_table && !is_smoke {
        call.extend(owned(&["--ray-limit", "256"]));
    }
    if name == "results" && !has(&call, "--check") {
        // The document itself stays as it is.
        call.push("--check".into());
    }
    if name == "instructions" && !has(&call, "--json") {
        // One form for all.
        call.extend(owned(&["--json", "record.jsonl"]));
    }
    if options.out && !has(&call, "--out") && !is_help {
        call.extend(owned(&["--out", RUNS]));
    }
    Ok(Form::Small(SmallForm {
        arguments: call,
        needs: options.needs.filter(|_| !is_help),
    }))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn small_form(line: &str) -> String {
        match form_of(line) {
            Ok(Form::Small(form)) => form.arguments.join(" "),
            other => panic!("{line}: {other:?}"),
        }
    }

    #[test]
    fn commands_that_measure_run_as_smokes_over_generated_scenes() {
        for (line, expected) in [
            (
                "cargo xtask bench",
                "xtask bench --samples 1 --smoke --out runs",
            ),
            (
                "cargo xtask bench --scenes DIR --scene bunny --builder exact --samples 15",
                "xtask bench --scenes scenes --scene bunny --builder exact --samples 1 --smoke --out runs",
            ),
            ("cargo xtask results", "xtask results --check"),
            (
                "cargo xtask rays --scenes DIR",
                "xtask rays --scenes scenes --scene small --samples 1 --smoke --out runs",
            ),
            (
                "cargo xtask builds --growth --samples 3",
                "xtask builds --growth=20000 --samples 1 --smoke --out runs",
            ),
            (
                "cargo xtask paper merge-table --scenes DIR --scene a,b --rows 3,7 --peers",
                "xtask paper merge-table --scenes scenes --scene a,b --rows 3,7 --peers --samples 1 --ray-limit 256",
            ),
            (
                "cargo xtask paper grid-table --calibration FILE",
                "xtask paper grid-table --calibration calibration.json --samples 1 --smoke",
            ),
            (
                "cargo xtask compare A B",
                "xtask compare runs/latest runs/latest",
            ),
            (
                "cargo xtask instructions",
                "xtask instructions --json record.jsonl",
            ),
            (
                "cargo xtask instructions --scene a,b",
                "xtask instructions --json record.jsonl",
            ),
            ("cargo xtask rays --help", "xtask rays --help --smoke"),
        ] {
            assert_eq!(small_form(line), expected, "{line}");
        }
    }

    #[test]
    fn other_commands_run_on_less() {
        for (line, expected) in [
            (
                "cargo run --release -p kd-cli -- render room:8 --frames 0..250 -o a.gif",
                "run --quiet -p kd-cli -- render room:1 --frames 0..2 -o a.gif --size 32x24",
            ),
            (
                "cargo run --release --example picture -- bunny.ply",
                "run --quiet --example picture -- bunny.ply",
            ),
            ("cargo doc -p kd --open", "doc -p kd --no-deps"),
            (
                "cargo bench -p kd-bench",
                "test --workspace --features kd-oracle/long-tests,kd/serde,kd-bench/kernels --bench *",
            ),
            (
                "cargo test -p kd-sah --test quality -- --nocapture",
                "test --workspace --features kd-oracle/long-tests,kd/serde --test quality -- --nocapture",
            ),
        ] {
            assert_eq!(small_form(line), expected, "{line}");
        }
    }

    #[test]
    fn unknown_commands_are_refused() {
        for line in [
            "cargo xtask bnech",
            "cargo run -p kd-gui",
            "cargo frobnicate",
            "cargo test",
        ] {
            assert!(form_of(line).is_err(), "{line}");
        }
        assert!(
            matches!(
                form_of("cargo +nightly fuzz run read_ply"),
                Ok(Form::NotRun(_))
            ),
            "an exception"
        );
    }

    #[test]
    fn without_tools_less_is_left() {
        let form = |line: &str, installed: &[Tool]| match form_of(line) {
            Ok(Form::Small(form)) => {
                let form = form.with_tools(&|tool| installed.contains(&tool));
                form.map(|form| form.arguments.join(" "))
            }
            other => panic!("{line}: {other:?}"),
        };
        let with = "xtask bench --peers --samples 1 --smoke --out runs";
        let without = "xtask bench --samples 1 --smoke --out runs";
        let line = "cargo xtask bench --peers";
        assert_eq!(form(line, &[Tool::Embree]).as_deref(), Some(with));
        assert_eq!(form(line, &[]).as_deref(), Some(without));
        assert_eq!(form("cargo xtask rays", &[Tool::Valgrind]), None);
        assert_eq!(form("cargo xtask instructions", &[Tool::Embree]), None);
        let help = "cargo xtask rays --help";
        assert!(form(help, &[]).is_some(), "help needs nothing");
    }
}
