//! Does anything arrive, and of the right type?

use vigil_blocks::{Block, SensorFrame};
use vigil_cycle::Topic;
use vigil_setup::Setup;
use vigil_setup::schema::Source;

use super::Heard;
use crate::findings::{Finding, Status};

/// The first few findings: the source, the type, whether frames came.
pub fn findings(setup: &Setup, heard: &Heard) -> Vec<Finding> {
    let mut all = vec![source(setup, heard)];
    if setup.file.sensor.source != Source::Socket {
        all.push(types(setup, heard));
    }
    all.push(frames(setup, heard));
    all
}

fn source(setup: &Setup, heard: &Heard) -> Finding {
    let (path, source) = (setup.path.display(), setup.file.sensor.source);
    let who = if heard.is_graph_running {
        "the graph is running"
    } else {
        "no graph is running, this program listened in its place"
    };
    match source {
        Source::External | Source::Socket => {
            Finding::new("source", Status::Ok, format!("{path}: {source}; {who}"))
        }
        Source::Simulator | Source::Playback => Finding::new(
            "source",
            Status::Warning,
            format!(
                "{path}: sensor.source is {source}: the graph makes its own frames; give --source \
                 external or --source socket, or change the file; {who}"
            ),
        ),
    }
}

/// The type on the topic, which its first user has fixed.
fn types(setup: &Setup, heard: &Heard) -> Finding {
    let path = Topic::Sensor.path(&setup.file.graph.name);
    let (name, size, alignment) = (
        SensorFrame::TYPE_NAME,
        size_of::<SensorFrame>(),
        align_of::<SensorFrame>(),
    );
    let wanted = format!("{name}, {size} bytes, alignment {alignment}");
    let Some(found) = &heard.topic else {
        let detail = format!("{path} does not exist; wanted is {wanted}");
        return Finding::new("type", Status::Failure, detail);
    };
    let same = (found.type_name.as_str(), found.size, found.alignment) == (name, size, alignment);
    if same {
        let (buffer, readers) = (found.buffer, found.max_subscribers);
        let detail = format!(
            "{wanted}; iceoryx2 {}; {buffer} frames may wait, {} publisher and {readers} readers \
             are admitted",
            found.version, found.max_publishers
        );
        return Finding::new("type", Status::Ok, detail);
    }
    let mut differs = Vec::new();
    if found.type_name != name {
        differs.push(difference(&found.type_name));
    }
    if found.size != size {
        differs.push(format!("its size is {} bytes, not {size}", found.size));
    }
    if found.alignment != alignment {
        let is = found.alignment;
        differs.push(format!("its alignment is {is} bytes, not {alignment}"));
    }
    let detail = format!(
        "{path} was made with another type (iceoryx2 {}): {}. Wanted is {wanted}. Make your types \
         anew with 'vigil types c' or 'vigil types python', and stop whoever holds the topic",
        found.version,
        differs.join("; "),
    );
    Finding::new("type", Status::Failure, detail)
}

/// What of the name is different: another block, another version, another layout.
fn difference(found: &str) -> String {
    let parts = |name: &str| -> Vec<String> { name.split('.').map(str::to_owned).collect() };
    let (is, wanted) = (parts(found), parts(SensorFrame::TYPE_NAME));
    let names = ["the project", "the block", "the version", "the schema hash"];
    if is.len() != wanted.len() {
        return format!("its type is called '{found}'");
    }
    let different = names.iter().zip(is.iter().zip(&wanted));
    let different = different.filter(|(_, (a, b))| a != b);
    let told: Vec<String> = different
        .map(|(what, (a, b))| format!("{what} is '{a}', not '{b}'"))
        .collect();
    told.join(", ")
}

fn frames(setup: &Setup, heard: &Heard) -> Finding {
    let (count, seconds) = (heard.frames.len() as u64 + heard.more, heard.seconds);
    if count > 0 {
        let detail = format!("{count} in {seconds:.1} s");
        return Finding::new("frames", Status::Ok, detail);
    }
    let refused: u64 = heard.rejected.iter().sum();
    if refused > 0 {
        let detail = format!("none in {seconds:.1} s was taken, {refused} were refused: see there");
        return Finding::new("frames", Status::Failure, detail);
    }
    let sensor = &setup.file.sensor;
    let folder = setup
        .domain()
        .map(|domain| domain.folder().display().to_string())
        .unwrap_or_default();
    let graph = &setup.file.graph.name;
    let how = if sensor.source == Source::Socket {
        let socket = &sensor.socket;
        format!(
            "send datagrams of {} bytes to udp {} or unix {folder}/{}",
            vigil_blocks::datagram::DATAGRAM_SIZE,
            socket.udp,
            socket.unix
        )
    } else {
        format!(
            "publish on '{}' with iceoryx2 0.10, prefix 'vigil_{graph}_', root path '{folder}/t', \
             and notify the event service of the same name; a publisher with another type or \
             version is refused by the transport and never seen here",
            Topic::Sensor.path(graph)
        )
    };
    let detail = format!("none in {seconds:.1} s: {how}");
    Finding::new("frames", Status::Failure, detail)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_part_of_the_name_that_differs_is_told() {
        let hash = format!("{:016x}", SensorFrame::SCHEMA);
        let old = "vigil.SensorFrame.v1.0123456789abcdef";
        let expected = format!("the schema hash is '0123456789abcdef', not '{hash}'");
        assert_eq!(difference(old), expected);
        let other = format!("vigil.Health.v1.{hash}");
        assert_eq!(
            difference(&other),
            "the block is 'Health', not 'SensorFrame'"
        );
        assert_eq!(
            difference("SensorFrame"),
            "its type is called 'SensorFrame'"
        );
    }
}
