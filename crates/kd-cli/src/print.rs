//! Output to the user.

use std::fmt::Arguments;
use std::io::{self, ErrorKind, Write};

/// Prints a line to stdout. A closed pipe is not an error, so that pictures are still written.
pub(crate) fn print_line(line: Arguments<'_>) -> io::Result<()> {
    match writeln!(io::stdout(), "{line}") {
        Err(error) if error.kind() == ErrorKind::BrokenPipe => Ok(()),
        done => done,
    }
}
