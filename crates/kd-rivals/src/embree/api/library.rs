//! Opens the library, and finds out which version it is.

use std::env;
use std::env::consts::{DLL_PREFIX, DLL_SUFFIX};
use std::error::Error;
use std::ffi::{OsStr, OsString};
use std::iter;
use std::sync::OnceLock;

use libloading::Library;

use super::shared::{self, Common};
use super::{v3, v4};
use crate::{EMBREE_VARIABLE, RivalError};

/// An open library.
#[derive(Debug)]
pub(crate) enum Embree {
    V3(Functions<v3::Queries>),
    V4(Functions<v4::Queries>),
}

/// The functions of the library.
#[derive(Debug)]
pub(crate) struct Functions<V> {
    pub(crate) common: Common,
    pub(crate) queries: V,
    /// The version as one number: see [`shared::VERSION`].
    version: usize,
    /// Keeps the library open, and so the functions valid.
    _library: Library,
}

/// The library, which is opened at the first call.
pub(crate) fn library() -> Result<&'static Embree, RivalError> {
    static OPENED: OnceLock<Result<Embree, RivalError>> = OnceLock::new();
    let opened = OPENED.get_or_init(|| load(&library_names(env::var_os(EMBREE_VARIABLE))));
    opened.as_ref().map_err(Clone::clone)
}

/// The file that the user names, or else the names of both versions, 3 first: recorded figures are over Embree 3. The name with a
/// version exists without the files for developers.
fn library_names(by_user: Option<OsString>) -> Vec<OsString> {
    if let Some(name) = by_user.filter(|name| !name.is_empty()) {
        return vec![name];
    }
    let of_version = |major: u32| {
        let plain = format!("{DLL_PREFIX}embree{major}{DLL_SUFFIX}");
        [format!("{plain}.{major}"), plain]
    };
    let names = [3, 4].into_iter().flat_map(of_version);
    names.map(OsString::from).collect()
}

/// Opens the first library of these that is there.
fn load(names: &[OsString]) -> Result<Embree, RivalError> {
    let mut whys = Vec::new();
    for name in names {
        match open(name) {
            Ok(opened) => return Ok(opened),
            Err(why) => whys.push(why),
        }
    }
    Err(RivalError::NotInstalled(whys.join("; ")))
}

fn open(name: &OsStr) -> Result<Embree, String> {
    let with_causes = |error: libloading::Error| with_causes(&error);
    // SAFETY: opening runs the start-up code of Embree and of its libraries, which have no requirements on the program.
    let library = unsafe { Library::new(name) }.map_err(with_causes)?;
    // SAFETY: the headers of both versions declare these functions; Embree 2 lacks one of them.
    let common = unsafe { Common::of(&library) }.map_err(with_causes)?;
    let version = common.version()?;
    match version / 10_000 {
        3 => {
            // SAFETY: this is Embree 3.
            let queries = unsafe { v3::Queries::of(&library) }.map_err(with_causes)?;
            Ok(Embree::V3(Functions {
                common,
                queries,
                version,
                _library: library,
            }))
        }
        4 => {
            // SAFETY: this is Embree 4.
            let queries = unsafe { v4::Queries::of(&library) }.map_err(with_causes)?;
            Ok(Embree::V4(Functions {
                common,
                queries,
                version,
                _library: library,
            }))
        }
        _ => Err(format!(
            "{}: version {version} is neither 3 nor 4",
            name.display()
        )),
    }
}

impl Common {
    /// The version as one number. Only a device knows it.
    fn version(&self) -> Result<usize, String> {
        // SAFETY: the text ends with 0.
        let device = unsafe { (self.new_device)(c"threads=1,set_affinity=0".as_ptr()) };
        if device.is_null() {
            return Err("Embree creates no device".into());
        }
        // SAFETY: the device is valid, and the property is one of its enumeration.
        let version = unsafe { (self.device_property)(device, shared::VERSION) };
        // SAFETY: the device is valid, and this is its one reference.
        unsafe { (self.release_device)(device) };
        Ok(version.max(0).unsigned_abs())
    }
}

impl Embree {
    /// Its name with its version, such as `Embree 3.13.5`.
    pub(crate) fn name(&self) -> String {
        let (Self::V3(Functions { version, .. }) | Self::V4(Functions { version, .. })) = self;
        let [major, minor, patch] = [version / 10_000, version / 100 % 100, version % 100];
        format!("Embree {major}.{minor}.{patch}")
    }
}

/// The texts of an error and of its causes.
fn with_causes(error: &dyn Error) -> String {
    let all = iter::successors(Some(error), |&error: &&dyn Error| error.source());
    let texts: Vec<String> = all.map(ToString::to_string).collect();
    texts.join(": ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn without_the_library_the_message_says_how_to_install_it() {
        let missing = load(&["libembree-that-is-not-there.so".into()])
            .expect_err("no such library exists")
            .to_string();
        for part in [
            "libembree-that-is-not-there.so",
            "apt-get install libembree-dev",
        ] {
            assert!(missing.contains(part), "{part} in: {missing}");
        }
        assert!(!missing.contains('\n'), "one line: {missing}");
    }

    #[test]
    fn the_user_names_the_only_library_or_version_3_is_first() {
        let names = library_names(Some("some/folder/libembree4.so".into()));
        assert_eq!(names, ["some/folder/libembree4.so"], "no other");
        for none in [None, Some(OsString::new())] {
            let names = library_names(none);
            let majors = names
                .iter()
                .map(|name| name.to_string_lossy().contains('3'));
            assert_eq!(majors.collect::<Vec<_>>(), [true, true, false, false]);
        }
    }
}
