//! A program's commands and options as a document, for another program that shows them as its own.

use std::io;
use std::path::Path;
use std::process;

use clap::builder::{PossibleValue, PossibleValuesParser};
use clap::{Arg, ArgAction, Command};
use serde::{Deserialize, Serialize};

use crate::output;

/// The only word of a program that is asked for its tree.
const WORD: &str = "--command-tree";

/// A command, with what is below it.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct CommandTree {
    name: String,
    about: Option<String>,
    long_about: Option<String>,
    options: Vec<OptionEntry>,
    commands: Vec<CommandTree>,
}

/// An option or argument.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
struct OptionEntry {
    id: String,
    long: Option<String>,
    short: Option<char>,
    help: Option<String>,
    long_help: Option<String>,
    /// Names of its values; none of a flag.
    values: Vec<String>,
    choices: Vec<Choice>,
    default: Vec<String>,
    /// The environment's variable that it is read from.
    env: Option<String>,
    is_required: bool,
    takes_many: bool,
    is_counted: bool,
}

/// One of the values that an option takes.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
struct Choice {
    name: String,
    help: Option<String>,
}

impl CommandTree {
    /// What a program declares, but for what it hides, `help` and `version`.
    #[must_use]
    pub fn new(command: &Command) -> Self {
        let shown = |arg: &&Arg| {
            let is_own = !["help", "version"].contains(&arg.get_id().as_str());
            is_own && !arg.is_hide_set()
        };
        let commands = command.get_subcommands().filter(|it| !it.is_hide_set());
        Self {
            name: command.get_name().to_owned(),
            about: command.get_about().map(ToString::to_string),
            long_about: command.get_long_about().map(ToString::to_string),
            options: command
                .get_arguments()
                .filter(shown)
                .map(OptionEntry::new)
                .collect(),
            commands: commands
                .filter(|it| it.get_name() != "help")
                .map(Self::new)
                .collect(),
        }
    }

    /// Prints that of a program which is asked for it; `None` if it is not.
    pub fn answer(mut program: Command) -> Option<io::Result<()>> {
        let mut words = std::env::args_os().skip(1);
        let is_asked = words.next().is_some_and(|word| word == WORD) && words.next().is_none();
        is_asked.then(|| {
            program.build();
            output::json(&Self::new(&program))
        })
    }

    /// Asks another program.
    ///
    /// # Errors
    /// One that cannot be started, or does not answer.
    pub fn ask(program: &Path) -> io::Result<Self> {
        let output = process::Command::new(program).arg(WORD).output()?;
        if !output.status.success() {
            let said = String::from_utf8_lossy(&output.stderr);
            return Err(io::Error::other(format!("{}: {said}", output.status)));
        }
        Ok(serde_json::from_slice(&output.stdout)?)
    }

    /// The same as a declaration. It lives as long as the program.
    #[must_use]
    pub fn command(self) -> Command {
        let name: &'static str = self.name.leak();
        let mut command = Command::new(name);
        if let Some(about) = self.about {
            command = command.about(about);
        }
        if let Some(about) = self.long_about {
            command = command.long_about(about);
        }
        let args = self.options.into_iter().map(OptionEntry::arg);
        let commands = self.commands.into_iter().map(Self::command);
        command.args(args).subcommands(commands)
    }

    /// The commands below it.
    #[must_use]
    pub fn commands(self) -> Vec<Self> {
        self.commands
    }
}

impl OptionEntry {
    fn new(arg: &Arg) -> Self {
        let takes_values = arg.get_action().takes_values();
        let names = arg.get_value_names().unwrap_or_default().iter();
        let choices = match takes_values {
            true => arg.get_possible_values(),
            false => Vec::new(),
        };
        let shown = choices.iter().filter(|it| !it.is_hide_set());
        Self {
            id: arg.get_id().to_string(),
            long: arg.get_long().map(str::to_owned),
            short: arg.get_short(),
            help: arg.get_help().map(ToString::to_string),
            long_help: arg.get_long_help().map(ToString::to_string),
            values: match takes_values {
                true => names.map(ToString::to_string).collect(),
                false => Vec::new(),
            },
            choices: shown.map(Choice::new).collect(),
            default: match takes_values {
                true => arg.get_default_values().iter(),
                false => [].iter(),
            }
            .map(|value| value.to_string_lossy().into_owned())
            .collect(),
            env: arg
                .get_env()
                .map(|name| name.to_string_lossy().into_owned()),
            is_required: arg.is_required_set(),
            takes_many: arg
                .get_num_args()
                .is_some_and(|range| range.max_values() > 1),
            is_counted: matches!(arg.get_action(), ArgAction::Count),
        }
    }

    fn arg(self) -> Arg {
        let id: &'static str = self.id.leak();
        let mut arg = Arg::new(id).required(self.is_required);
        if let Some(long) = self.long {
            let long: &'static str = long.leak();
            arg = arg.long(long);
        }
        if let Some(short) = self.short {
            arg = arg.short(short);
        }
        if let Some(help) = self.help {
            arg = arg.help(help);
        }
        if let Some(help) = self.long_help {
            arg = arg.long_help(help);
        }
        if let Some(name) = self.env {
            let name: &'static str = name.leak();
            arg = arg.env(name).hide_env_values(true);
        }
        if self.is_counted {
            return arg.action(ArgAction::Count);
        }
        if self.values.is_empty() {
            return arg.action(ArgAction::SetTrue);
        }
        let leaked = |text: String| -> &'static str { text.leak() };
        arg = arg.value_names(self.values.into_iter().map(leaked));
        if self.takes_many {
            arg = arg.num_args(1..);
        }
        if !self.choices.is_empty() {
            let choices = self.choices.into_iter().map(Choice::value);
            arg = arg.value_parser(PossibleValuesParser::new(choices));
        }
        arg.default_values(self.default.into_iter().map(leaked))
    }
}

impl Choice {
    fn new(value: &PossibleValue) -> Self {
        Self {
            name: value.get_name().to_owned(),
            help: value.get_help().map(ToString::to_string),
        }
    }

    fn value(self) -> PossibleValue {
        let name: &'static str = self.name.leak();
        let value = PossibleValue::new(name);
        match self.help {
            Some(help) => value.help(help),
            None => value,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn program() -> Command {
        let kind = PossibleValuesParser::new([
            PossibleValue::new("fast").help("Soon"),
            PossibleValue::new("exact"),
        ]);
        let solve = Command::new("solve")
            .about("Solves a model.")
            .long_about("Solves a model.\n\nIt takes a while.")
            .arg(
                Arg::new("model")
                    .value_name("MODEL")
                    .required(true)
                    .help("The model"),
            )
            .arg(
                Arg::new("more")
                    .long("more")
                    .value_name("FILE")
                    .num_args(1..),
            )
            .arg(
                Arg::new("kind")
                    .long("kind")
                    .short('k')
                    .value_name("KIND")
                    .value_parser(kind)
                    .default_value("fast")
                    .help("Which"),
            )
            .arg(
                Arg::new("json")
                    .long("json")
                    .action(ArgAction::SetTrue)
                    .help("For programs"),
            )
            .arg(
                Arg::new("secret")
                    .long("secret")
                    .hide(true)
                    .action(ArgAction::SetTrue),
            );
        let pomdp = Command::new("pomdp").about("Models.").subcommand(solve);
        let hidden = Command::new("hidden").hide(true);
        Command::new("program").subcommands([pomdp, hidden])
    }

    #[test]
    fn what_is_made_of_the_document_has_the_same_help() {
        let mut original = program();
        let document = serde_json::to_string(&CommandTree::new(&original)).unwrap();
        let read: CommandTree = serde_json::from_str(&document).unwrap();
        let mut copy = read.command();
        copy.clone().debug_assert();
        let helps = [&mut original, &mut copy].map(|command| {
            let pomdp = command.find_subcommand_mut("pomdp").unwrap();
            let of_all = pomdp.render_long_help().to_string();
            let solve = pomdp.find_subcommand_mut("solve").unwrap();
            of_all + &solve.render_long_help().to_string()
        });
        assert!(helps[0].contains("- fast:  Soon"), "{}", helps[0]);
        assert_eq!(helps[0], helps[1]);
        assert!(copy.find_subcommand("hidden").is_none());
    }
}
