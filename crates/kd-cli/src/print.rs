//! Output to the user.

use std::fmt::Arguments;
use std::io::{self, ErrorKind, Write};

use indicatif::{ProgressBar, ProgressStyle};

/// Prints a line to stdout. A closed pipe is not an error, so that pictures are still written.
pub(crate) fn print_line(line: Arguments<'_>) -> io::Result<()> {
    match writeln!(io::stdout(), "{line}") {
        Err(error) if error.kind() == ErrorKind::BrokenPipe => Ok(()),
        done => done,
    }
}

/// A progress bar on stderr, which shows nothing where that is no terminal. `template` is in the notation of indicatif.
pub(crate) fn progress_bar(length: Option<u64>, template: &str) -> ProgressBar {
    let bar = length.map_or_else(ProgressBar::no_length, ProgressBar::new);
    let style = ProgressStyle::with_template(template);
    bar.with_style(style.expect("the template is well-formed"))
}
