//! The configurations that ship, changed.

use std::path::PathBuf;

use vigil_setup::graph_file::GraphFile;
use vigil_setup::load_graph;

/// Reads a graph of `config/` after a change of it; the message if it is refused.
pub fn load(name: &str, change: impl FnOnce(&mut GraphFile)) -> Result<(), String> {
    let config = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../config");
    let change = |file: &mut GraphFile| {
        // One core is enough to read a configuration.
        for service in [
            &mut file.services.sensor_sim,
            &mut file.services.detector,
            &mut file.services.identifier,
            &mut file.services.supervisor,
        ] {
            service.core = 0;
        }
        change(file);
    };
    load_graph(&config.join(name), change)
        .map(|_| ())
        .map_err(|error| error.to_string())
}
