//! Which crate of the workspace may depend on which.

use serde_json::Value;

/// The allowed edges, and the only machine-readable list of them. `docs/architecture.md` explains them.
/// Dev-dependencies are free: tests may look at anything.
const EDGES: &[(&str, &[&str])] = &[
    ("kd-buffer", &[]),
    ("kd-core", &["kd-buffer"]),
    ("kd-tasks", &[]),
    ("kd-simd", &[]),
    ("kd-sah", &["kd-core", "kd-simd", "kd-tasks"]),
    ("kd-merge", &["kd-core", "kd-sah", "kd-tasks"]),
    ("kd-wide", &["kd-buffer", "kd-core", "kd-simd", "kd-tasks"]),
    (
        "kd-trace",
        &["kd-buffer", "kd-core", "kd-simd", "kd-tasks", "kd-wide"],
    ),
    (
        "kd-points",
        &["kd-core", "kd-simd", "kd-tasks", "kd-trace", "kd-wide"],
    ),
    ("kd-file", &["kd-buffer", "kd-core"]),
    ("kd-grid", &["kd-core", "kd-tasks", "kd-trace"]),
    ("kd-oracle", &["kd-core", "kd-trace"]),
    ("kd-comparators", &["kd-core", "kd-tasks", "kd-trace"]),
    ("kd-rivals", &["kd-core", "kd-trace"]),
    ("kd-scene", &["kd-core"]),
    ("kd-select", &["kd-grid", "kd-trace"]),
    ("kd-render", &["kd", "kd-scene", "kd-trace"]),
    ("kd-cli", &["kd", "kd-render", "kd-scene"]),
    (
        "kd",
        &[
            "kd-core",
            "kd-file",
            "kd-grid",
            "kd-merge",
            "kd-points",
            "kd-sah",
            "kd-select",
            "kd-tasks",
            "kd-trace",
            "kd-wide",
            "kd-scene",
        ],
    ),
    (
        "kd-bench",
        &[
            "kd",
            "kd-comparators",
            "kd-core",
            "kd-grid",
            "kd-merge",
            "kd-render",
            "kd-rivals",
            "kd-sah",
            "kd-select",
            "kd-trace",
            "kd-scene",
        ],
    ),
    ("xtask", &[]),
];

/// Compares the output of `cargo metadata` with [`EDGES`].
pub(super) fn check(metadata: &Value) -> Vec<String> {
    let none = Vec::new();
    let packages = metadata["packages"].as_array().unwrap_or(&none);
    let names: Vec<&str> = packages.iter().filter_map(|p| p["name"].as_str()).collect();
    let mut complaints = Vec::new();
    for package in packages {
        let name = package["name"].as_str().unwrap_or_default();
        let Some((_, allowed)) = EDGES.iter().find(|(crate_name, _)| *crate_name == name) else {
            complaints.push(format!("crate `{name}` has no row in EDGES ({})", file!()));
            continue;
        };
        for dependency in package["dependencies"].as_array().unwrap_or(&none) {
            let target = dependency["name"].as_str().unwrap_or_default();
            let is_dev = dependency["kind"].as_str() == Some("dev");
            if names.contains(&target) && !is_dev && !allowed.contains(&target) {
                complaints.push(format!("`{name}` must not depend on `{target}`"));
            }
        }
    }
    for (name, _) in EDGES {
        if !names.contains(name) {
            complaints.push(format!(
                "EDGES has a row for `{name}`, which is not in the workspace"
            ));
        }
    }
    complaints
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    fn workspace(dependencies_of_sah: &Value) -> Value {
        let packages: Vec<Value> = EDGES
            .iter()
            .map(|(name, _)| {
                let own = if *name == "kd-sah" {
                    dependencies_of_sah.clone()
                } else {
                    json!([])
                };
                json!({"name": name, "dependencies": own})
            })
            .collect();
        json!({ "packages": packages })
    }

    #[test]
    fn allowed_edges_pass() {
        let dependencies = json!([
            {"name": "kd-core", "kind": null},
            {"name": "rayon", "kind": null},
            {"name": "kd-trace", "kind": "dev"},
        ]);
        assert_eq!(
            check(&workspace(&dependencies)),
            [""; 0],
            "all of these are fine"
        );
    }

    #[test]
    fn a_forbidden_edge_is_found_for_normal_and_build_dependencies() {
        for kind in [Value::Null, json!("build")] {
            let dependencies = json!([{"name": "kd-trace", "kind": kind}]);
            assert_eq!(
                check(&workspace(&dependencies)),
                ["`kd-sah` must not depend on `kd-trace`"],
                "siblings do not know each other"
            );
        }
    }

    #[test]
    fn the_table_and_the_workspace_name_the_same_crates() {
        let mut metadata = workspace(&json!([]));
        let packages = metadata["packages"].as_array_mut().expect("just made");
        packages.remove(0);
        packages.push(json!({"name": "kd-new", "dependencies": []}));
        let complaints = check(&metadata).join("\n");
        assert!(complaints.contains("`kd-new` has no row"), "{complaints}");
        assert!(complaints.contains("row for `kd-buffer`"), "{complaints}");
    }
}
