//! Reader of MTL, the material files of OBJ.
//!
//! A statement that has no meaning is left out with a warning; all others are read.

use std::path::Path;

use glam::Vec3;

use super::statements::{Statements, rest, without_comment};
use crate::error::quoted;
use crate::report::{Place, Report, WarningCode};
use crate::source::Source;
use crate::words::{Words, number};
use crate::{AlphaMode, Material};

/// A material of a file.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct MtlMaterial {
    pub(super) name: String,
    diffuse: Option<Vec3>,
    specular: Option<Vec3>,
    emission: Option<Vec3>,
    shine: Option<f32>,
    /// 1 is opaque.
    opacity: Option<f32>,
    refraction: Option<f32>,
    illumination: Option<u32>,
    /// The path of the diffuse texture, as the file writes it.
    pub(super) texture: Option<String>,
    /// The path of the texture of opacity.
    pub(super) alpha_texture: Option<String>,
}

/// Reads the materials of a file.
pub(super) fn read_mtl(bytes: &[u8], path: &Path, report: &mut Report) -> Vec<MtlMaterial> {
    let file = path.display().to_string();
    let mut materials: Vec<MtlMaterial> = Vec::new();
    let mut source = Source::of_bytes(bytes, &file);
    let Ok(mut statements) = Statements::new(&mut source) else {
        return materials;
    };
    // Bytes in memory can be read without errors.
    while let Ok(Some((line, statement))) = statements.next() {
        let Some(keyword) = Words::new(statement).next() else {
            continue;
        };
        let keyword = String::from_utf8_lossy(keyword).into_owned();
        let place = Some(Place::Line(line));
        if keyword == "newmtl" {
            let name = rest(statement, &keyword);
            if name.is_empty() {
                report.warn(
                    &file,
                    place,
                    WarningCode::BadMaterial,
                    "a material has no name",
                );
            }
            materials.push(MtlMaterial {
                name,
                ..MtlMaterial::default()
            });
            continue;
        }
        let Some(material) = materials.last_mut() else {
            let message = "a statement precedes the first material; it is left out";
            report.warn(&file, place, WarningCode::BadMaterial, message);
            continue;
        };
        match material.set(&keyword, statement) {
            Set::Done => {}
            Set::Unused => {
                let message = format!("`{keyword}` is not used");
                report.warn(&file, place, WarningCode::Unused, message);
            }
            Set::WouldHide => {
                let message = "`Tr 1` would hide the surface; it is opaque";
                report.warn(&file, place, WarningCode::BadMaterial, message);
            }
            Set::Bad => {
                let message = format!("bad statement, left out: {}", quoted(statement));
                report.warn(&file, place, WarningCode::BadMaterial, message);
            }
        }
    }
    materials
}

/// What became of a statement.
enum Set {
    Done,
    Unused,
    Bad,
    /// The surface would be invisible.
    WouldHide,
}

impl MtlMaterial {
    fn set(&mut self, keyword: &str, statement: &[u8]) -> Set {
        let is_set = match keyword {
            "Kd" => assign(&mut self.diffuse, color(statement)),
            "Ks" => assign(&mut self.specular, color(statement)),
            "Ke" => assign(&mut self.emission, color(statement)),
            "Ns" => assign(&mut self.shine, last_number(statement)),
            "Ni" => assign(&mut self.refraction, last_number(statement)),
            "d" => assign(&mut self.opacity, last_number(statement)),
            // MeshLab and others write `Tr 1` for an opaque surface; by the text of MTL, it is invisible.
            "Tr" if last_number(statement) == Some(1.0) => return Set::WouldHide,
            "Tr" => assign(&mut self.opacity, last_number(statement).map(|x| 1.0 - x)),
            "illum" => {
                let model = rest(statement, keyword).parse().ok();
                assign(&mut self.illumination, model)
            }
            // Most files have any color here; the diffuse one serves.
            "Ka" => true,
            "map_Kd" => assign(&mut self.texture, texture(&rest(statement, keyword))),
            "map_d" => assign(&mut self.alpha_texture, texture(&rest(statement, keyword))),
            _ => return Set::Unused,
        };
        if is_set { Set::Done } else { Set::Bad }
    }

    /// The material of a scene, without its textures.
    pub(super) fn material(&self) -> Material {
        let diffuse = self.diffuse.unwrap_or(Vec3::splat(0.8));
        // Under a texture, black means that the texture alone gives the color.
        let diffuse = if self.texture.is_some() && diffuse == Vec3::ZERO {
            Vec3::ONE
        } else {
            diffuse
        };
        let specular = self.specular.unwrap_or(Vec3::ZERO);
        // Illumination models below 3 have highlights, but no mirror reflection.
        let opacity = self.opacity.unwrap_or(1.0).clamp(0.0, 1.0);
        // A texture of opacity makes holes and blends; without one, the surface is clear as glass is.
        let (alpha, alpha_mode, transmittance) = match self.alpha_texture {
            Some(_) => (opacity, AlphaMode::Blend, 0.0),
            None => (1.0, AlphaMode::Opaque, 1.0 - opacity),
        };
        let is_mirror = self.illumination.is_some_and(|model| model >= 3);
        Material {
            // The ambient color in most files is meaningless.
            ambient: 0.25 * diffuse,
            diffuse,
            specular,
            mirror: if is_mirror { specular } else { Vec3::ZERO },
            shine: self.shine.unwrap_or(0.0).max(0.0),
            transmittance,
            refraction: self.refraction.unwrap_or(1.0),
            emission: self.emission.unwrap_or(Vec3::ZERO),
            alpha,
            alpha_mode,
            ..Material::default()
        }
    }
}

/// Sets a value where there is one.
fn assign<T>(to: &mut Option<T>, value: Option<T>) -> bool {
    let is_some = value.is_some();
    if is_some {
        *to = value;
    }
    is_some
}

/// The numbers of a statement; `None` if one is not finite or no number.
fn numbers(statement: &[u8]) -> Option<Vec<f32>> {
    let finite = |word| number(word).filter(|number| number.is_finite());
    Words::new(statement).skip(1).map(finite).collect()
}

/// Red, green and blue; the first one is all three where the others are left out.
fn color(statement: &[u8]) -> Option<Vec3> {
    match numbers(statement)?.as_slice() {
        [gray] => Some(Vec3::splat(*gray)),
        [red, green, blue] => Some(Vec3::new(*red, *green, *blue)),
        _ => None,
    }
}

/// The last word, a number: an option may precede it, as in `d -halo 0.5`.
fn last_number(statement: &[u8]) -> Option<f32> {
    let word = Words::new(statement).skip(1).last()?;
    number(word).filter(|number| number.is_finite())
}

/// The path of a texture, which may have blanks, after its options.
fn texture(text: &str) -> Option<String> {
    let mut left = text.trim_start();
    while left.starts_with('-') {
        let (option, after) = left.split_once(char::is_whitespace)?;
        let (least, most) = match option {
            "-mm" => (2, 2),
            "-o" | "-s" | "-t" => (1, 3),
            _ => (1, 1),
        };
        left = after.trim_start();
        for number in 0..most {
            let (word, after) = left.split_once(char::is_whitespace)?;
            if number >= least && word.parse::<f32>().is_err() {
                break;
            }
            left = after.trim_start();
        }
    }
    // A comment may follow, unless the name goes on with its extension.
    let named = without_comment(left);
    let left = if named.contains('.') { named } else { left };
    // Some files use backslashes in paths.
    (!left.is_empty()).then(|| left.replace('\\', "/"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::Strictness;

    fn read(text: &[u8]) -> (Vec<MtlMaterial>, Vec<String>) {
        let mut report = Report::new(Strictness::Usual);
        let materials = read_mtl(text, Path::new("a.mtl"), &mut report);
        let warnings = report.finish().iter().map(ToString::to_string).collect();
        (materials, warnings)
    }

    #[test]
    fn one_bad_statement_is_lost_alone() {
        let rows: [(&str, &str); 10] = [
            (
                "Tr 1.000000",
                "line 2: `Tr 1` would hide the surface; it is opaque",
            ),
            ("Kd", "line 2: bad statement, left out: `Kd`"),
            ("Kd 0 1", "line 2: bad statement, left out: `Kd 0 1`"),
            (
                "Kd spectral a.rfl",
                "line 2: bad statement, left out: `Kd spectral a.rfl`",
            ),
            (
                "Kd nan 0 0",
                "line 2: bad statement, left out: `Kd nan 0 0`",
            ),
            ("Ns", "line 2: bad statement, left out: `Ns`"),
            ("map_Kd", "line 2: bad statement, left out: `map_Kd`"),
            ("illum x", "line 2: bad statement, left out: `illum x`"),
            ("map_Bump a.png", "line 2: `map_Bump` is not used"),
            ("newmtl", "line 2: a material has no name"),
        ];
        for (statement, warning) in rows {
            let text = format!("newmtl a\n{statement}\nnewmtl b\nKd 0 1 0\n");
            let (materials, warnings) = read(text.as_bytes());
            assert_eq!(warnings, [format!("a.mtl: {warning}")], "{statement}");
            let last = materials.last().expect("two or three");
            assert_eq!(
                (&*last.name, last.diffuse),
                ("b", Some(Vec3::Y)),
                "{statement}"
            );
        }
    }

    #[test]
    fn usual_statements_are_read() {
        let (materials, warnings) = read(
            b"\xef\xbb\xbfnewmtl first one\nKd 0.5\nKs 0.1 0.2 0.3\nNs 12\nd -halo 0.25\nNi 1.5\nillum 3\n\
              map_Kd -s 2 2 -clamp on a b.png\nnewmtl caf\xe9\nTr 0.25 # glass\nmap_Kd tex\\wall.png\n\
              newmtl leaf\nd 0.75\nmap_d -imfchan m tex\\leaf.png\n",
        );
        assert_eq!(warnings, [""; 0]);
        let [first, second, leaf] = materials.as_slice() else {
            panic!("{materials:?}");
        };
        let material = first.material();
        assert_eq!(first.name, "first one");
        assert_eq!(material.diffuse, Vec3::splat(0.5), "one number is gray");
        assert_eq!(material.mirror, Vec3::new(0.1, 0.2, 0.3));
        assert_eq!((material.shine, material.transmittance), (12.0, 0.75));
        assert_eq!(material.refraction, 1.5);
        assert_eq!(first.texture.as_deref(), Some("a b.png"));
        assert_eq!(second.material().transmittance, 0.25);
        assert_eq!(second.texture.as_deref(), Some("tex/wall.png"));
        assert!(second.name.starts_with("caf"), "a byte that is no UTF-8");
        assert_eq!(leaf.alpha_texture.as_deref(), Some("tex/leaf.png"));
        let leaf = leaf.material();
        assert_eq!((leaf.alpha, leaf.alpha_mode), (0.75, AlphaMode::Blend));
        assert_eq!(leaf.transmittance, 0.0, "alpha alone");
    }

    #[test]
    fn every_input_is_read() {
        const FRAGMENTS: [&[u8]; 20] = [
            b"newmtl ", b"Kd", b"Ks ", b"map_Kd ", b"-s ", b"-mm ", b"-clamp ", b"-", b"1 ",
            b"nan ", b"0.5", b" ", b"\n", b"\\\n", b"#", b"d ", b"Tr ", b"illum ", b"\xff", b"\0",
        ];
        let mut rng = fastrand::Rng::with_seed(4);
        let mut count = 0;
        for _ in 0..20_000 {
            let parts = (0..rng.usize(0..12)).map(|_| FRAGMENTS[rng.usize(0..FRAGMENTS.len())]);
            let text = [b"newmtl a\n", parts.collect::<Vec<_>>().concat().as_slice()].concat();
            let (materials, _) = read(&text);
            count += materials.len();
            for material in materials {
                let made = material.material();
                assert!(made.diffuse.is_finite() && made.transmittance.is_finite());
            }
        }
        assert!(count > 20_000, "{count} materials");
    }

    #[test]
    fn nothing_before_a_material_is_read() {
        let (materials, warnings) = read(b"Kd");
        assert_eq!(materials, []);
        let expected = "a.mtl: line 1: a statement precedes the first material; it is left out";
        assert_eq!(warnings, [expected]);
    }
}
