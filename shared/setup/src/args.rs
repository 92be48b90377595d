//! Command-line options that every program of the graph shares.

use std::error::Error;
use std::fmt::Display;
use std::path::PathBuf;

use vigil_cycle::serve::Leave;
use vigil_diagnosis::identify::IdentifierFilter;

use crate::border::Border;
use crate::document::Document;
use crate::graph_file::Source;
use crate::load::Setup;
use crate::problem::SetupError;

/// Which graph, and what to change in it for this start.
#[derive(Debug, Clone, Default, PartialEq, clap::Args)]
pub struct GraphArgs {
    /// Graph file (TOML).
    #[arg(
        long,
        env = "VIGIL_CONFIG",
        default_value = "config/rover.toml",
        value_name = "FILE"
    )]
    pub config: PathBuf,
    /// Rate of the schedule, Hz; replaces `graph.rate_hz`.
    #[arg(long, value_name = "HZ", allow_negative_numbers = true)]
    pub rate: Option<f64>,
    /// Name of the graph; replaces `graph.name`, so that one file can run twice.
    #[arg(long, value_name = "NAME")]
    pub graph: Option<String>,
    /// Seed; replaces `graph.seed`.
    // A TOML file holds no larger one.
    #[arg(long, value_name = "S",
        value_parser = clap::value_parser!(u64).range(..=i64::MAX as u64))]
    pub seed: Option<u64>,
    /// Identification filter; replaces `identifier.filter`.
    #[arg(long, value_name = "NAME")]
    pub identifier: Option<IdentifierFilter>,
    /// Where sensor frames come from; replaces `sensor.source`.
    #[arg(long, value_name = "SOURCE", conflicts_with = "replay")]
    pub source: Option<Source>,
    /// Address of the UDP socket for `--source socket`, such as 127.0.0.1:7402; replaces
    /// `sensor.socket.udp`. Without it a graph that `--graph` names has a port of its own, by its
    /// name.
    #[arg(long, value_name = "ADDRESS")]
    pub socket: Option<String>,
    /// Play these recorded frames (CSV or CSV.gz) instead of the simulator.
    #[arg(long, value_name = "FILE")]
    pub replay: Option<PathBuf>,
    /// Runs to play: `all`, `heldout` (those that the model was not learned from), or ids
    /// separated by commas.
    #[arg(long, value_name = "LIST", requires = "replay")]
    pub runs: Option<String>,
    /// Speed of the playback relative to the recording.
    #[arg(long, value_name = "FACTOR", requires = "replay")]
    pub speed: Option<f64>,
}

/// Options of every service process.
#[derive(Debug, Clone, PartialEq, clap::Args)]
pub struct ServiceArgs {
    #[command(flatten)]
    #[allow(missing_docs)] // Would replace the options' own texts.
    pub graph: GraphArgs,
    /// Document of a launcher that has read the configuration and all models: read in place of the
    /// graph file, options applied.
    #[arg(long, value_name = "FILE", hide = true)]
    pub setup: Option<PathBuf>,
    /// Where to leave the run report.
    #[arg(long, value_name = "FILE")]
    pub report: Option<PathBuf>,
    /// Where to leave the stamps of the last cycles; see `--stamped-cycles`.
    #[arg(long, value_name = "FILE")]
    pub stamps: Option<PathBuf>,
    /// Cycles whose stamps are kept.
    #[arg(long, value_name = "N", default_value_t = 100_000, requires = "stamps")]
    pub stamped_cycles: usize,
    /// Keep no histograms; for measuring what they cost.
    #[arg(long)]
    pub no_timing: bool,
    /// Only read and check everything that the service needs; exit code 0 or 2.
    #[arg(long)]
    pub check: bool,
}

impl ServiceArgs {
    /// Reads and checks what the launcher has handed on, else as [`GraphArgs::load`].
    ///
    /// # Errors
    /// Every problem found, at once.
    pub fn load(&self) -> Result<Setup, SetupError> {
        match &self.setup {
            Some(document) => Document::read_text(document)?.check(),
            None => self.graph.load(),
        }
    }

    /// Reads and checks as [`Self::load`], and assembles what the service runs.
    ///
    /// # Errors
    /// Every problem of the files; what does not fit together, with the graph file's name.
    pub fn prepare<T, E: Display>(
        &self,
        assemble: impl FnOnce(&Setup) -> Result<T, E>,
    ) -> Result<(Setup, T), Box<dyn Error>> {
        let setup = self.load()?;
        let assembled =
            assemble(&setup).map_err(|error| format!("{}: {error}", setup.path.display()))?;
        Ok((setup, assembled))
    }

    /// What the service is to leave behind when it stops.
    #[must_use]
    pub fn leave(&self) -> Leave {
        let stamped = |path: &PathBuf| (path.clone(), self.stamped_cycles);
        Leave {
            report: self.report.clone(),
            stamps: self.stamps.as_ref().map(stamped),
            no_timing: self.no_timing,
        }
    }
}

impl GraphArgs {
    /// Reads the graph file and the files that it names, applies these options, checks all.
    ///
    /// # Errors
    /// Every problem found, at once; see [`SetupError`].
    pub fn load(&self) -> Result<Setup, SetupError> {
        self.read()?.check()
    }

    /// Reads graph file and robot, applies these options, checks both. Models may be missing.
    ///
    /// # Errors
    /// Every problem found, at once.
    pub fn border(&self) -> Result<Border, SetupError> {
        self.read()?.border()
    }

    /// Reads the graph file and the files that it names, and applies these options.
    ///
    /// # Errors
    /// Why the graph file cannot be understood.
    pub fn read(&self) -> Result<Document, SetupError> {
        let mut document = self.read_replaced()?;
        let pairs = self.replaced();
        document.replaced = pairs
            .map(|(key, option)| (key.into(), option.into()))
            .collect();
        Ok(document)
    }

    /// Keys of the graph file whose values are replaced, each with the option that does.
    fn replaced(&self) -> impl Iterator<Item = (&'static str, &'static str)> {
        let given = [
            ("graph.rate_hz", "--rate", self.rate.is_some()),
            ("graph.name", "--graph", self.graph.is_some()),
            ("graph.seed", "--seed", self.seed.is_some()),
            (
                "identifier.filter",
                "--identifier",
                self.identifier.is_some(),
            ),
            ("sensor.source", "--source", self.source.is_some()),
            ("sensor.socket.udp", "--socket", self.socket.is_some()),
            ("sensor.source", "--replay", self.replay.is_some()),
            ("sensor.frames", "--replay", self.replay.is_some()),
            ("sensor.runs", "--runs", self.runs.is_some()),
            ("sensor.speed", "--speed", self.speed.is_some()),
        ];
        let given = given.into_iter().filter(|(.., is_given)| *is_given);
        given.map(|(key, option, _)| (key, option))
    }

    fn read_replaced(&self) -> Result<Document, SetupError> {
        Document::read(&self.config, |file| {
            if let Some(rate_hz) = self.rate {
                file.graph.rate_hz = rate_hz;
            }
            if let Some(name) = &self.graph
                && *name != file.graph.name
            {
                file.graph.name.clone_from(name);
                file.sensor.socket.rename(name);
            }
            if let Some(address) = &self.socket {
                file.sensor.socket.udp = address.strip_prefix("udp:").unwrap_or(address).into();
            }
            if let Some(seed) = self.seed {
                file.graph.seed = seed;
            }
            if let Some(filter) = self.identifier {
                file.identifier.filter = filter;
            }
            if let Some(source) = self.source {
                file.sensor.source = source;
            }
            if let Some(frames) = &self.replay {
                file.sensor.source = Source::Playback;
                let absolute = std::path::absolute(frames).unwrap_or_else(|_| frames.clone());
                file.sensor.frames = Some(absolute.display().to_string());
                file.sensor.runs.clone_from(&self.runs);
                file.sensor.speed = self.speed;
            }
        })
    }
}
