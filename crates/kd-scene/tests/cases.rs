//! Small files of kinds that were once read wrongly, with what they hold.

use std::path::PathBuf;

use kd_core::Mesh;
use kd_scene::{LoadOptions, Loaded, Strictness, WarningCode, load_mesh_with};

fn path(name: &str) -> PathBuf {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../../testdata/cases");
    PathBuf::from(folder).join(name)
}

#[track_caller]
fn load(name: &str, strictness: Strictness) -> Loaded<Mesh> {
    let options = LoadOptions::new().with_strictness(strictness);
    let loaded = load_mesh_with(path(name), &options);
    loaded.unwrap_or_else(|error| panic!("{error}"))
}

fn area(mesh: &Mesh) -> f32 {
    let corners = (0..).take(mesh.len()).map(|number| mesh.corners(number));
    let areas = corners.map(|[a, b, c]| 0.5 * (b - a).cross(c - a).length());
    areas.sum()
}

#[test]
fn files_have_their_triangles_and_warnings() {
    use WarningCode::{BadPolygon, FewCorners, LeftOver, Unused};
    let rows: [(&str, usize, &[WarningCode]); 19] = [
        ("o03_concave.obj", 6, &[]),
        ("o05_w.obj", 4, &[Unused]),
        ("o12_dangling_normals.obj", 4, &[]),
        ("o14_two_corners.obj", 4, &[FewCorners]),
        ("o22b_short_vn.obj", 1, &[]),
        ("o27_mtl_spectral.obj", 4, &[]),
        ("o28_kd_one_number.obj", 4, &[]),
        ("m02.obj", 4, &[]),
        ("m12.obj", 4, &[]),
        ("panic_min.obj", 1, &[]),
        ("t2.obj", 4, &[]),
        ("p10_bom.ply", 4, &[]),
        ("p11_concave.ply", 6, &[]),
        ("p16b_indented_header.ply", 4, &[]),
        ("p20_latin1_comment.ply", 4, &[]),
        ("p21_trailing_garbage.ply", 4, &[LeftOver]),
        ("p22_left_over_line.ply", 4, &[LeftOver]),
        ("p25_vertex_split_lines.ply", 4, &[]),
        ("crossed.obj", 2, &[BadPolygon]),
    ];
    for (name, triangles, expected) in rows {
        let loaded = load(name, Strictness::Usual);
        assert_eq!(loaded.value.len(), triangles, "{name}");
        let codes: Vec<WarningCode> = loaded.warnings.iter().map(|it| it.code).collect();
        assert_eq!(codes, expected, "{name}: {:?}", loaded.warnings);
        let options = LoadOptions::new().with_strictness(Strictness::Strict);
        let strict = load_mesh_with(path(name), &options);
        assert_eq!(strict.is_ok(), expected.is_empty(), "{name}: strict");
    }
}

#[test]
fn concave_polygons_have_their_area() {
    for name in ["o03_concave.obj", "p11_concave.ply"] {
        let area = area(&load(name, Strictness::Usual).value);
        assert!((area - 10.0).abs() < 1e-5, "{name}: {area}");
    }
}

#[test]
fn a_lenient_reader_leaves_out_a_vertex_that_is_not_finite() {
    let name = "p13_nan_vertex.ply";
    let loaded = load(name, Strictness::Lenient);
    assert_eq!(loaded.value.len(), 4);
    let codes: Vec<_> = loaded.warnings.iter().map(|it| it.code).collect();
    assert_eq!(codes, [WarningCode::NotFinite]);
    let error = load_mesh_with(path(name), &LoadOptions::new()).expect_err("usual");
    assert!(error.to_string().contains("is not finite"), "{error}");
}

#[cfg(feature = "scenes")]
mod scenes {
    use glam::Vec3;
    use kd_scene::{SceneDescription, TextureSource, load_scene_with};

    use super::*;

    fn scene(name: &str) -> SceneDescription {
        let loaded = load_scene_with(path(name), &LoadOptions::new());
        loaded.unwrap_or_else(|error| panic!("{error}")).value
    }

    #[test]
    fn one_odd_statement_loses_no_other_material() {
        use WarningCode::{BadAttribute, BadMaterial, FewCorners, Unused};
        let rows: [(&str, &[WarningCode]); 10] = [
            ("m02.obj", &[]),
            ("m03.obj", &[BadMaterial]),
            ("m12.obj", &[]),
            ("m13.obj", &[BadMaterial]),
            ("m14.obj", &[BadMaterial]),
            ("o12_dangling_normals.obj", &[BadAttribute]),
            ("o14_two_corners.obj", &[FewCorners]),
            ("o22b_short_vn.obj", &[BadAttribute]),
            ("o27_mtl_spectral.obj", &[BadMaterial]),
            ("o05_w.obj", &[Unused]),
        ];
        for (name, expected) in rows {
            let scene = scene(name);
            let codes: Vec<_> = scene.warnings.iter().map(|it| it.code).collect();
            assert_eq!(codes, expected, "{name}: {:?}", scene.warnings);
        }
    }

    #[test]
    fn materials_are_those_of_their_files() {
        let (green, gray) = (Vec3::Y, Vec3::splat(0.5));
        for (name, diffuse) in [
            ("m02.obj", gray),
            ("m12.obj", green),
            ("m13.obj", green),
            ("m14.obj", green),
            ("o27_mtl_spectral.obj", green),
            ("o28_kd_one_number.obj", gray),
        ] {
            let scene = scene(name);
            let material = scene.parts[0].surface.materials[0] as usize;
            assert_eq!(scene.materials[material].diffuse, diffuse, "{name}");
        }
        let scene = scene("t2.obj");
        let file = path("red tile.png");
        assert_eq!(scene.textures[0].source, TextureSource::File(file));
    }

    #[test]
    fn nff_files_have_their_triangles_and_warnings() {
        let short = scene("n05_short_fill.nff");
        assert_eq!(short.parts[0].mesh.len(), 1);
        assert_eq!(short.materials[0].diffuse, Vec3::X);
        assert_eq!(short.warnings[0].code, WarningCode::BadMaterial);
        let cones = load("n11_cone0.nff", Strictness::Usual);
        let codes: Vec<_> = cones.warnings.iter().map(|it| it.code).collect();
        assert_eq!(
            codes,
            [WarningCode::BadElement],
            "the cylinder of no length"
        );
        assert!(!cones.value.is_empty(), "the others are there");
    }

    #[test]
    fn gltf_files_have_their_triangles_and_warnings() {
        use WarningCode::{BadAnimation, BadAttribute, Unused};
        let rows: [(&str, usize, &[WarningCode]); 16] = [
            ("g04_custom_attribute", 2, &[]),
            ("g05_extras_0", 2, &[]),
            ("g05_extras_1", 2, &[]),
            ("g06_quantization", 2, &[]),
            ("g07_required_EXT_texture_webp", 2, &[]),
            ("g07_required_KHR_lights_punctual", 2, &[]),
            ("g10_no_position", 2, &[Unused]),
            ("g11_empty_scene", 2, &[]),
            ("g12b_no_target_node", 2, &[BadAnimation]),
            ("g13_texture_no_source", 2, &[BadAttribute]),
            ("g16_nopad", 2, &[]),
            ("g20b_gpu_instancing", 6, &[]),
            ("g26_color0", 2, &[]),
            ("g34_alpha", 2, &[]),
            ("g35_sampler", 2, &[]),
            ("g37_stride2", 2, &[]),
        ];
        for (name, triangles, expected) in rows {
            let name = format!("{name}.gltf");
            let loaded = load(&name, Strictness::Usual);
            assert_eq!(loaded.value.len(), triangles, "{name}");
            let codes: Vec<WarningCode> = loaded.warnings.iter().map(|it| it.code).collect();
            assert_eq!(codes, expected, "{name}: {:?}", loaded.warnings);
        }
        let colored = scene("g26_color0.gltf");
        assert_eq!(colored.parts[0].surface.colors, [[Vec3::X; 3]; 2]);
        for (name, found) in [
            ("g23_draco", "KHR_draco_mesh_compression"),
            ("g27_gltf1", "glTF 1"),
        ] {
            let refused = load_mesh_with(path(&format!("{name}.gltf")), &LoadOptions::new());
            let error = refused.expect_err(name).to_string();
            assert!(error.contains(found), "{error}");
        }
    }
}
