//! Which place of a frame has which name.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use vigil_blocks::SensorFrame;

/// Which place of a frame's command and channels has which name: a robot's channel list.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Channels {
    robot_hash: u64,
    axes: BTreeMap<String, usize>,
    channels: BTreeMap<String, usize>,
}

/// What is wrong with a channel list, or with a name.
#[derive(Debug, thiserror::Error)]
pub enum ChannelError {
    /// The file cannot be read.
    #[error("{0}: {1}")]
    File(String, std::io::Error),
    /// The text is none.
    #[error("no channel list: it has no line 'robot HASH NAME'")]
    NoRobot,
    /// The robot has no such axis or channel.
    #[error("'{name}' is none of {known}")]
    Unknown {
        /// The name.
        name: String,
        /// Those that there are.
        known: String,
    },
}

impl Channels {
    /// The list of a file: `channels` of a running graph, or what `vigil channels` printed.
    ///
    /// # Errors
    /// [`ChannelError`].
    pub fn read(path: &Path) -> Result<Self, ChannelError> {
        let text = fs::read_to_string(path)
            .map_err(|error| ChannelError::File(path.display().to_string(), error))?;
        Self::parse(&text)
    }

    /// The list of a text.
    ///
    /// # Errors
    /// [`ChannelError::NoRobot`].
    pub fn parse(text: &str) -> Result<Self, ChannelError> {
        let mut list = Self::default();
        for line in text.lines() {
            let mut words = line.split_whitespace();
            let (kind, number, name) = (words.next(), words.next(), words.next());
            let (Some(number), Some(name)) = (number, name) else {
                continue;
            };
            let places = match kind {
                Some("command") => &mut list.axes,
                Some("channel") => &mut list.channels,
                Some("robot") => {
                    list.robot_hash = u64::from_str_radix(number, 16).unwrap_or_default();
                    continue;
                }
                _ => continue,
            };
            if let Ok(place) = number.parse() {
                places.insert(name.to_owned(), place);
            }
        }
        if list.robot_hash == 0 {
            return Err(ChannelError::NoRobot);
        }
        Ok(list)
    }

    /// Writes a channel of `frame` and marks it as measured.
    ///
    /// # Errors
    /// [`ChannelError::Unknown`], with the names that there are.
    pub fn set(&self, frame: &mut SensorFrame, name: &str, value: f64) -> Result<(), ChannelError> {
        let place = find(&self.channels, name, frame.channel.len())?;
        frame.channel[place] = value;
        frame.channel_valid |= 1 << place;
        frame.robot_hash = self.robot_hash;
        Ok(())
    }

    /// The same for an axis of the command.
    ///
    /// # Errors
    /// As [`Self::set`].
    pub fn command(
        &self,
        frame: &mut SensorFrame,
        name: &str,
        value: f64,
    ) -> Result<(), ChannelError> {
        let place = find(&self.axes, name, frame.command.len())?;
        frame.command[place] = value;
        frame.command_valid |= 1 << place;
        frame.robot_hash = self.robot_hash;
        Ok(())
    }
}

fn find(places: &BTreeMap<String, usize>, name: &str, count: usize) -> Result<usize, ChannelError> {
    let place = places.get(name).copied().filter(|&place| place < count);
    place.ok_or_else(|| ChannelError::Unknown {
        name: name.to_owned(),
        known: places.keys().cloned().collect::<Vec<_>>().join(", "),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_are_set_by_name_and_marked_and_a_wrong_name_tells_the_right_ones() {
        let text = "robot 00000000000000ab rover\ncommand 1 speed m/s\nchannel 2 yaw rad\n\
                    channel 3 gyro rad/s\nchannel 99 far -\n";
        let (list, mut frame) = (Channels::parse(text).unwrap(), SensorFrame::default());
        list.set(&mut frame, "yaw", 0.5).unwrap();
        list.command(&mut frame, "speed", 0.2).unwrap();
        assert_eq!((frame.channel[2], frame.channel_valid), (0.5, 1 << 2));
        assert_eq!((frame.command[1], frame.command_valid), (0.2, 1 << 1));
        assert_eq!(frame.robot_hash, 0xab);
        let wrong = list.set(&mut frame, "yam", 1.0).unwrap_err().to_string();
        assert_eq!(wrong, "'yam' is none of far, gyro, yaw");
        // A place that no frame has is none.
        assert!(list.set(&mut frame, "far", 1.0).is_err());
        assert!(Channels::parse("channel 0 x m\n").is_err());
    }
}
