//! Does anything arrive, and of the right type?

use vigil_blocks::{Block, SensorFrame};
use vigil_cycle::Topic;
use vigil_cycle::domain::{Domain, Queues};
use vigil_cycle::port::FoundTopic;
use vigil_setup::Border;
use vigil_setup::graph_file::Source;

use super::Reception;
use crate::findings::{Finding, Status};

/// Publishers that the graph lets a topic admit.
const PUBLISHERS: usize = 1;

/// Frames from which their announcement is judged.
const ANNOUNCED_MIN: u64 = 5;

/// The first few findings: the source, the type, its topic's settings, whether frames came.
pub fn findings(border: &Border, heard: &Reception) -> Vec<Finding> {
    let mut all = vec![source(border, heard)];
    if border.file.sensor.source != Source::Socket {
        all.push(types(border, heard));
        let demanded = border.file.transport.for_topic(Topic::Sensor);
        let found = heard.topic.as_ref();
        all.extend(found.map(|found| settings(demanded, found)));
    }
    all.push(frames(border, heard));
    if border.file.sensor.source != Source::Socket {
        all.extend(notification(border, heard));
    }
    all
}

fn source(border: &Border, heard: &Reception) -> Finding {
    let (path, source) = (border.path.display(), border.file.sensor.source);
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
fn types(border: &Border, heard: &Reception) -> Finding {
    let path = Topic::Sensor.path(&border.file.graph.name);
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
        let detail = format!("{wanted}; iceoryx2 {}", found.version);
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

/// Settings of the topic, which its first user has fixed, beside those of the graph: who opens it
/// is refused if it has less.
fn settings(demanded: Queues, found: &FoundTopic) -> Finding {
    let each = [
        ("frames that may wait", found.buffer, demanded.buffer),
        ("publishers", found.max_publishers, PUBLISHERS),
        ("readers", found.max_subscribers, demanded.max_subscribers),
    ];
    let told = each.map(|(what, is, wanted)| format!("{what}: {is}, the graph's {wanted}"));
    let detail = told.join("; ");
    if each.iter().all(|(_, is, wanted)| is == wanted) {
        return Finding::new("settings", Status::Ok, detail);
    }
    let is_less = each.iter().any(|(_, is, wanted)| is < wanted);
    let (status, what) = if is_less {
        (Status::Failure, "the graph cannot open it")
    } else {
        (Status::Warning, "the graph can open it")
    };
    let detail = format!(
        "{detail}: a program has made the topic with settings of its own, {what}. Stop it; a \
         publisher must open the topic (open()) once the graph has made it, and not create it \
         (open_or_create())"
    );
    Finding::new("settings", status, detail)
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

/// Whether each frame is announced by the event that wakes the graph.
fn notification(border: &Border, heard: &Reception) -> Option<Finding> {
    let (count, silent) = (heard.frames.len() as u64 + heard.more, heard.unannounced);
    if count < ANNOUNCED_MIN {
        return None;
    }
    let path = Topic::Sensor.path(&border.file.graph.name);
    Some(match heard.is_silent() {
        true => Finding::new(
            "notification",
            Status::Failure,
            format!(
                "frames arrive but no notification: {silent} of {count} without an event, so that \
                 nothing wakes the graph. Notify the event service '{path}' after each frame"
            ),
        ),
        false => Finding::new("notification", Status::Ok, "events announce the frames"),
    })
}

fn frames(border: &Border, heard: &Reception) -> Finding {
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
    let sensor = &border.file.sensor;
    let (folder, prefix) = border
        .domain()
        .map(|domain| {
            let folder = domain.folder().display().to_string();
            (folder, domain.transport_prefix())
        })
        .unwrap_or_default();
    let graph = &border.file.graph.name;
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
            "publish on '{}' with iceoryx2 0.10, prefix '{prefix}', root path '{folder}/t', and \
             notify the event service of the same name; a publisher with another type or \
             version is refused by the transport and never seen here",
            Topic::Sensor.path(graph)
        )
    };
    let running = Domain::all_running();
    let others = running.iter().map(String::as_str);
    let others: Vec<&str> = others.filter(|name| name != graph).collect();
    let elsewhere = match others.is_empty() {
        true => String::new(),
        false => format!(". Other graphs that run: {}", others.join(", ")),
    };
    let detail = format!("none in {seconds:.1} s: {how}{elsewhere}");
    Finding::new("frames", Status::Failure, detail)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn settings_of_another_maker_are_told_beside_the_graphs() {
        let demanded = Queues {
            buffer: 128,
            history: 1,
            max_subscribers: 8,
        };
        let of = |buffer, max_publishers, max_subscribers| {
            let found = FoundTopic {
                path: "vigil/rover/sensor".to_owned(),
                type_name: SensorFrame::TYPE_NAME.to_owned(),
                size: size_of::<SensorFrame>(),
                alignment: align_of::<SensorFrame>(),
                version: "0.10.0".to_owned(),
                buffer,
                max_publishers,
                max_subscribers,
            };
            settings(demanded, &found)
        };
        let same = of(128, 1, 8);
        assert_eq!(same.status, Status::Ok);
        let expected = "frames that may wait: 128, the graph's 128; publishers: 1, the graph's 1; \
                        readers: 8, the graph's 8";
        assert_eq!(same.detail, expected);
        // The transport's own, with which `open_or_create()` makes a topic.
        let own = of(2, 2, 8);
        assert_eq!(own.status, Status::Failure);
        let detail = own.detail;
        for told in [
            "frames that may wait: 2, the graph's 128; publishers: 2, the graph's 1",
            "must open the topic (open())",
        ] {
            assert!(detail.contains(told), "{detail}");
        }
        assert_eq!(of(128, 1, 7).status, Status::Failure);
        assert_eq!(of(128, 2, 8).status, Status::Warning);
        assert_eq!(of(256, 1, 16).status, Status::Warning);
    }

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
