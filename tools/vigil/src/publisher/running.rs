//! Where a running graph takes its frames from: options may have changed what its file says.

use std::fs;

use vigil_cycle::PortError;
use vigil_cycle::topic::ServiceName;
use vigil_setup::Border;
use vigil_setup::graph_file::Source;

/// The source of the running graph of this name; the file's if none is running.
///
/// # Errors
/// That there is no place for a graph.
pub fn source(border: &Border) -> Result<Source, PortError> {
    let (domain, sensor) = (border.domain()?, &border.file.sensor);
    let Ok(processes) = fs::read_to_string(domain.processes_file()) else {
        return Ok(sensor.source);
    };
    let has_sensor_sim = processes
        .lines()
        .any(|line| line.split(' ').next() == Some(ServiceName::SensorSim.as_str()));
    let socket = &sensor.socket.unix;
    let has_socket = !socket.is_empty() && domain.folder().join(socket).exists();
    Ok(if !has_sensor_sim {
        Source::External
    } else if has_socket {
        Source::Socket
    } else {
        sensor.source
    })
}
