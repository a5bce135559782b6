//! What a file says of the extensions that it uses.

use serde_json::Value;

use super::json::Document;
use crate::LoadError;
use crate::report::{Place, Report, WarningCode};

/// Extensions that the reader uses.
const READ: [&str; 11] = [
    "EXT_mesh_gpu_instancing",
    "EXT_texture_webp",
    "KHR_lights_punctual",
    "KHR_materials_emissive_strength",
    "KHR_materials_ior",
    "KHR_materials_pbrSpecularGlossiness",
    "KHR_materials_transmission",
    "KHR_materials_unlit",
    "KHR_mesh_quantization",
    "KHR_node_visibility",
    "KHR_texture_transform",
];

/// Compressions of geometry. A file that does not require one has the geometry without it too.
const COMPRESSIONS: [&str; 3] = [
    "KHR_draco_mesh_compression",
    "EXT_meshopt_compression",
    "KHR_meshopt_compression",
];

/// How the names of extensions begin, after their vendor, that change only looks, sounds, behavior or descriptions.
const HARMLESS: [&str; 16] = [
    "animation_pointer",
    "audio",
    "collections",
    "environment_map",
    "instance_features",
    "interactivity",
    "lights",
    "materials",
    "mesh_features",
    "node_hoverability",
    "node_selectability",
    "structural_metadata",
    "technique",
    "texture",
    "vrm",
    "xmp",
];

/// Refuses what the file requires and the reader lacks, and warns of the other extensions that are not used.
pub(super) fn check(document: &Document, file: &str, report: &mut Report) -> Result<(), LoadError> {
    const REQUIRED: &str = "/extensionsRequired";
    for (number, name) in document
        .all(REQUIRED)
        .iter()
        .filter_map(Value::as_str)
        .enumerate()
    {
        if READ.contains(&name) || is_harmless(name) {
            continue;
        }
        let pointer = format!("{REQUIRED}/{number}");
        let problem = format!("{name} is not supported");
        let error = document.bad_value(&pointer, problem);
        if COMPRESSIONS.contains(&name) {
            return Err(error);
        }
        let place = Some(Place::Pointer(pointer));
        let what = format!("the extension {name} is required; it is not used");
        report.leave_out(error, place, WarningCode::Unused, &what)?;
    }
    const USED: &str = "/extensionsUsed";
    for (number, name) in document
        .all(USED)
        .iter()
        .filter_map(Value::as_str)
        .enumerate()
    {
        let is_required = document
            .all(REQUIRED)
            .iter()
            .any(|it| it.as_str() == Some(name));
        let is_reported = is_required && !is_harmless(name);
        if READ.contains(&name) || COMPRESSIONS.contains(&name) || is_reported {
            continue;
        }
        let place = Some(Place::Pointer(format!("{USED}/{number}")));
        let what = format!("the extension {name} is not used");
        report.warn(file, place, WarningCode::Unused, what);
    }
    Ok(())
}

fn is_harmless(name: &str) -> bool {
    let own = name.split_once('_').map_or(name, |(_, own)| own);
    HARMLESS.iter().any(|prefix| own.starts_with(prefix)) || name.starts_with("VRM")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Strictness;

    #[test]
    fn what_is_required_is_there_or_refused() {
        let check = |text: &str, strictness| {
            let document = Document::parse(text.as_bytes(), "a").expect("valid");
            let mut report = Report::new(strictness);
            let done = check(&document, "a", &mut report);
            (
                done.map_err(|error| error.to_string()),
                report.finish().len(),
            )
        };
        let required = |name: &str| {
            format!("{{\"extensionsUsed\": [\"{name}\"], \"extensionsRequired\": [\"{name}\"]}}")
        };
        for (name, warnings) in [
            ("KHR_mesh_quantization", 0),
            ("KHR_materials_clearcoat", 1),
            ("EXT_lights_ies", 1),
            ("ADOBE_materials_thin_transparency", 1),
            ("VRMC_springBone", 1),
        ] {
            let (done, found) = check(&required(name), Strictness::Usual);
            assert_eq!((done, found), (Ok(()), warnings), "{name}");
        }
        for (name, may_be_left_out) in [
            ("KHR_draco_mesh_compression", false),
            ("EXT_meshopt_compression", false),
            ("MY_curves", true),
        ] {
            let expected = format!("a: /extensionsRequired/0: {name} is not supported");
            let (done, _) = check(&required(name), Strictness::Usual);
            assert_eq!(done, Err(expected), "{name}");
            let (done, _) = check(&required(name), Strictness::Lenient);
            assert_eq!(done.is_ok(), may_be_left_out, "{name}");
        }
        let used = "{\"extensionsUsed\": [\"KHR_draco_mesh_compression\", \"MY_curves\"]}";
        assert_eq!(check(used, Strictness::Usual), (Ok(()), 1));
    }
}
