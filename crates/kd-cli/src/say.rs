//! What is told to whoever runs the program.

use std::fmt::Arguments;
use std::io::{self, ErrorKind, Write};

/// Prints a line. That nobody reads any more is no failure: pictures are made all the same.
pub(crate) fn say(line: Arguments<'_>) -> io::Result<()> {
    match writeln!(io::stdout(), "{line}") {
        Err(error) if error.kind() == ErrorKind::BrokenPipe => Ok(()),
        done => done,
    }
}
