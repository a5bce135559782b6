//! `kd cast`: rays in, hits out.

mod program;

use std::path::Path;

use kd::glam::Vec3;
use kd::{BuildOptions, KdTree, Ray};
use kd_scene::{Lidar, Spd};

#[track_caller]
fn cast(folder: &Path, arguments: &[&str]) -> String {
    program::stdout_of(folder, &[&["cast"], arguments].concat())
}

#[track_caller]
fn error_of(folder: &Path, arguments: &[&str]) -> String {
    program::error_of(folder, &[&["cast"], arguments].concat())
}

fn balls() -> KdTree {
    let mesh = Spd::Balls.generate(1).expect("within the limits").mesh;
    KdTree::build(mesh, &BuildOptions::best()).expect("valid")
}

/// The rows of a CSV file after its head; empty fields are `None`.
fn rows(path: &Path) -> Vec<Vec<Option<f64>>> {
    let text = std::fs::read_to_string(path).expect("a file");
    let lines = text.lines().skip(1);
    let row = |line: &str| line.split(',').map(|field| field.parse().ok()).collect();
    lines.map(row).collect()
}

#[test]
fn rays_of_a_file_hit_what_the_library_says() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let at = folder.path();
    let tree = balls();
    let mut rng = fastrand::Rng::with_seed(4);
    let mut random = || Vec3::from_array(std::array::from_fn(|_| rng.f32() * 4.0 - 2.0));
    let mut rays: Vec<Ray> = (0..500).map(|_| Ray::new(random(), random())).collect();
    for ray in &mut rays[..100] {
        (ray.t_min, ray.t_max) = (0.25, 0.75);
    }
    // The columns of CSV may have any order, and others between them.
    let mut text = "dx,dy,dz,name,t_max,t_min,ox,oy,oz\n".to_owned();
    for Ray {
        origin: o,
        direction: d,
        t_min,
        t_max,
        ..
    } in &rays
    {
        text += &format!(
            "{},{},{},a,{t_max},{t_min},{},{},{}\n",
            d.x, d.y, d.z, o.x, o.y, o.z
        );
    }
    std::fs::write(at.join("rays.csv"), text).expect("written");
    let said = cast(at, &["balls:1", "rays.csv", "-o", "hits.csv"]);
    let hits: Vec<_> = rays.iter().map(|ray| tree.intersect(ray)).collect();
    let found = hits.iter().flatten().count();
    assert!(
        found > 50 && said.contains(&format!("hits.csv: 500 rays, {found} of which hit")),
        "{said}"
    );
    let rows = rows(&at.join("hits.csv"));
    assert_eq!(rows.len(), rays.len());
    for (number, (row, hit)) in rows.iter().zip(&hits).enumerate() {
        assert_eq!(row[0], Some(number as f64));
        let t = hit.map(|hit| hit.t.to_string().parse().expect("a number"));
        assert_eq!(row[1], t, "the shortest digits of t");
        assert_eq!(
            row[2],
            hit.map(|hit| f64::from(hit.triangle)),
            "ray {number}"
        );
        assert_eq!(row.iter().skip(1).all(Option::is_none), hit.is_none());
        if let (Some(hit), [Some(x), Some(y), Some(z)]) = (hit, [row[5], row[6], row[7]]) {
            let expected = tree.mesh().surface_point(hit).as_dvec3();
            assert!(
                (kd::glam::DVec3::new(x, y, z) - expected).length() < 1e-6,
                "ray {number}"
            );
        }
    }

    // The same rays without names, from an array, and as answers of yes and no.
    cast(at, &["balls:1", "rays.csv", "-o", "any.csv", "--any"]);
    let any: Vec<_> = self::rows(&at.join("any.csv"))
        .iter()
        .map(|row| row[1] == Some(1.0))
        .collect();
    assert_eq!(
        any,
        rays.iter()
            .map(|ray| tree.occluded(ray))
            .collect::<Vec<_>>()
    );
    cast(at, &["balls:1", "rays.csv", "-o", "any.npy", "--any"]);
    let bytes = std::fs::read(at.join("any.npy")).expect("a file");
    let file = npyz::NpyFile::new(bytes.as_slice()).expect("an array");
    assert_eq!(file.into_vec::<bool>().expect("of booleans"), any);
}

/// The point that is hit is 0.5 before the origin of the second ray.
#[test]
fn limits_are_optional_one_by_one() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let at = folder.path();
    std::fs::write(
        at.join("square.obj"),
        "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\n",
    )
    .expect("written");
    let rays =
        "\"ox\",\"oy\",\"oz\",\"dx\",\"dy\",\"dz\",\"t_max\"\n.5,.2,5,0,0,-1,2\n.5,.2,5,0,0,-1,9\n";
    std::fs::write(at.join("far.csv"), rays).expect("written");
    cast(at, &["square.obj", "far.csv"]);
    let hits = rows(&at.join("hits.csv"));
    assert_eq!([hits[0][1], hits[1][1]], [None, Some(5.0)]);
    let back = ".5,.2,-.5,0,0,-1,-9,0\n";
    std::fs::write(at.join("back.csv"), back).expect("written");
    cast(at, &["square.obj", "back.csv"]);
    let hits = rows(&at.join("hits.csv"));
    assert_eq!(
        (hits[0][1], hits[0][10]),
        (Some(-0.5), Some(-1.0)),
        "towards the origin"
    );
}

#[test]
fn arrays_are_read_and_written() {
    use npyz::WriterBuilder;

    let folder = tempfile::tempdir().expect("a temporary folder");
    let at = folder.path();
    let values = [
        [0.0, 0.0, 5.0, 0.0, 0.0, -1.0],
        [9.0, 9.0, 9.0, 1.0, 0.0, 0.0],
    ];
    for (name, width) in [("six.npy", 6), ("eight.npy", 8)] {
        let mut bytes = Vec::new();
        let options = npyz::WriteOptions::new().default_dtype().shape(&[2, width]);
        let mut writer = options.writer(&mut bytes).begin_nd().expect("an array");
        for row in values {
            writer.extend(row).expect("written");
            if width == 8 {
                writer.extend([0.0, f64::INFINITY]).expect("written");
            }
        }
        writer.finish().expect("written");
        std::fs::write(at.join(name), bytes).expect("written");
        cast(at, &["balls:1", name, "-o", "hits.npy"]);
        let bytes = std::fs::read(at.join("hits.npy")).expect("a file");
        let head = String::from_utf8_lossy(&bytes[..bytes.len().min(300)]).into_owned();
        assert!(head.contains("'shape': (2"), "{head}");
        for field in [
            "('ray', '<u8')",
            "('t', '<f4')",
            "('triangle', '<u4')",
            "('nz', '<f4')",
        ] {
            assert!(head.contains(field), "{field} in {head}");
        }
        // Two rows of 48 bytes.
        let rows = &bytes[bytes.len() - 96..];
        let float = |at: usize| f32::from_le_bytes(rows[at..at + 4].try_into().expect("four"));
        let hit = balls()
            .intersect(&Ray::new([0.0, 0.0, 5.0], [0.0, 0.0, -1.0]))
            .expect("a hit");
        assert_eq!((float(8), float(48 + 8)), (hit.t, f32::INFINITY), "{name}");
    }
}

#[test]
fn a_lidar_writes_points() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let at = folder.path();
    let arguments = [
        "balls:1",
        "lidar",
        "--at",
        "0,-3,1",
        "--channels",
        "8",
        "--steps",
        "90",
    ];
    let options = [
        "--elevation",
        "-30,30",
        "--range",
        "0.5,4",
        "-o",
        "points.las",
    ];
    cast(at, &[&arguments[..], &options].concat());
    let lidar = Lidar {
        channels: 8,
        steps: 90,
        elevation_degrees: [-30.0, 30.0],
        range: [0.5, 4.0],
        ..Lidar::new(Vec3::new(0.0, -3.0, 1.0), Vec3::Z)
    };
    let tree = balls();
    let rays = (0..90).flat_map(|step| (0..8).map(move |channel| lidar.ray(step, channel)));
    let hits: Vec<Vec3> = rays
        .filter_map(|ray| tree.intersect(&ray))
        .map(|hit| tree.mesh().surface_point(&hit))
        .collect();
    let mut reader = las::Reader::from_path(at.join("points.las")).expect("a LAS file");
    let points = reader.read_all().expect("its points");
    let points: Vec<las::Point> = points
        .points()
        .map(|point| point.expect("a point"))
        .collect();
    assert!(
        points.len() > 20 && points.len() == hits.len(),
        "{} {}",
        points.len(),
        hits.len()
    );
    for (point, hit) in points.iter().zip(&hits) {
        let [x, y, z] = hit.to_array().map(f64::from);
        let off = (point.x - x)
            .abs()
            .max((point.y - y).abs())
            .max((point.z - z).abs());
        assert!(off < 1e-5, "{off}");
    }
    assert!(
        points.iter().any(|point| point.intensity > 30_000),
        "some surface faces the sensor"
    );
}

#[test]
fn a_camera_has_a_ray_for_each_pixel() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let at = folder.path();
    let said = cast(at, &["gears:1", "camera", "--size", "30x20"]);
    assert!(said.contains("hits.csv: 600 rays"), "{said}");
    let rows = rows(&at.join("hits.csv"));
    let middle = rows[10 * 30 + 15][1];
    assert!(
        rows.len() == 600 && middle.is_some(),
        "the middle of the image shows the scene"
    );
}

#[test]
fn errors_name_file_and_place() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let at = folder.path();
    let write = |name: &str, text: &str| std::fs::write(at.join(name), text).expect("written");
    write("short.csv", "0  0 5  0 0 -1 \n0 0 5 0 0\n");
    write("seven.csv", "\n0,0,5,0,0,-1,7\n");
    write("typo.csv", "0,0,5,0,0,-1x\n");
    write("bad.csv", "ox,oy,oz,dx,dy,dz\n0,0,0,1,0,0\n0,0,0,1,x,0\n");
    write("nan.csv", "0,0,0,1,nan,0\n");
    write("zero.csv", "# none\n0,0,0,0,0,0\n");
    write("names.csv", "x,y,z\n");
    write("no.npy", "text");
    for (rays, expected) in [
        (
            "short.csv",
            "short.csv: line 2: 5 values, expected 6 as in the first line",
        ),
        ("bad.csv", "bad.csv: line 3: dy: `x`"),
        ("nan.csv", "nan.csv: line 1: dy is NaN"),
        ("zero.csv", "zero.csv: line 2: the direction is zero"),
        (
            "names.csv",
            "names.csv: line 1: no column `ox` among x, y, z; expected ox, oy, oz",
        ),
        ("no.npy", "no.npy: "),
        ("none.csv", "none.csv: cannot open"),
        (
            "rays.xyz",
            "rays.xyz: unknown format of rays; expected .csv, .npy, `camera` or `lidar`",
        ),
    ] {
        let error = error_of(at, &["balls:1", rays]);
        assert!(error.contains(expected), "{rays}: {error}");
    }
    let error = error_of(at, &["balls:1", "bad.csv", "-o", "./bad.csv"]);
    assert!(
        error.contains("bad.csv: is the input, and would be lost"),
        "{error}"
    );
    let error = error_of(at, &["balls:1", "camera", "-o", "hits.txt"]);
    assert!(
        error.contains("hits.txt: unknown format of hits; use .csv, .npy or .las"),
        "{error}"
    );
    let error = error_of(at, &["balls:1", "camera", "-o", "a.las", "--any"]);
    assert!(error.contains("--any finds none"), "{error}");
    let error = error_of(at, &["none.obj", "camera", "-o", "new.csv"]);
    assert!(
        error.contains("none.obj: cannot open") && !at.join("new.csv").exists(),
        "{error}"
    );
}

#[test]
fn a_tree_file_answers_as_its_scene() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let at = folder.path();
    program::stdout_of(at, &["convert", "balls:1", "-o", "balls.kd"]);
    let rays = ["lidar", "--channels", "8", "--steps", "50"];
    cast(
        at,
        &[&["balls:1"], &rays[..], &["-o", "scene.csv"]].concat(),
    );
    cast(
        at,
        &[&["balls.kd"], &rays[..], &["-o", "tree.csv"]].concat(),
    );
    let read = |name| std::fs::read_to_string(at.join(name)).expect("a file");
    assert_eq!(read("scene.csv"), read("tree.csv"));
    let stats = program::stdout_of(at, &["stats", "balls.kd"]);
    let of_scene = program::stdout_of(at, &["stats", "balls:1"]);
    let statistics = stats.split_once('\n').expect("a title").1;
    assert!(of_scene.ends_with(statistics), "{stats}");
    program::stdout_of(at, &["convert", "balls.kd", "-o", "again.ply"]);
    program::stdout_of(at, &["convert", "balls:1", "-o", "balls.ply"]);
    assert_eq!(
        std::fs::read(at.join("again.ply")).expect("a file"),
        std::fs::read(at.join("balls.ply")).expect("a file")
    );

    let mut bytes = std::fs::read(at.join("balls.kd")).expect("a file");
    let last = bytes.len() / 2;
    bytes[last] ^= 1;
    std::fs::write(at.join("bad.kd"), bytes).expect("written");
    let error = error_of(at, &["bad.kd", "lidar"]);
    assert!(
        error.contains("bad.kd: ") && error.contains("damaged"),
        "{error}"
    );
}

#[test]
fn parts_of_a_run_are_the_bytes_of_one() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let at = folder.path();
    let mut rng = fastrand::Rng::with_seed(8);
    let mut line = |_| {
        (0..6)
            .map(|_| (rng.f32() * 4.0 - 2.0).to_string() + ",")
            .collect::<String>()
    };
    let lines: Vec<String> = (0..101).map(&mut line).collect();
    std::fs::write(at.join("rays.csv"), lines.join("\n")).expect("written");
    program::stdout_of(at, &["convert", "balls:1", "-o", "balls.kd"]);
    let lidar = ["lidar", "--channels", "7", "--steps", "31"];
    let camera = ["camera", "--size", "13x11"];
    for rays in [&["rays.csv"][..], &lidar, &camera] {
        for any in [&[][..], &["--any"]] {
            for kind in ["csv", "npy"] {
                let run = |output: &str, more: &[&str]| {
                    let output = ["-o", output];
                    cast(at, &[&["balls.kd"], rays, any, &output, more].concat());
                    std::fs::read(at.join(output[1])).expect("a file")
                };
                let whole = run(&format!("whole.{kind}"), &[]);
                let parts = (1..=5).map(|part| {
                    let shard = format!("{part}/5");
                    run(&format!("part.{kind}"), &["--shard", &shard])
                });
                let parts: Vec<u8> = parts.flatten().collect();
                assert!(whole == parts, "{rays:?} {any:?} {kind}");
            }
        }
    }
    let error = error_of(at, &["balls.kd", "lidar", "-o", "a.las", "--shard", "1/2"]);
    assert!(error.contains("--shard: the header of LAS"), "{error}");
    let error = error_of(at, &["balls.kd", "lidar", "--shard", "3/2"]);
    assert!(error.contains("counted from 1"), "{error}");
}
