//! `vigil check-publisher`: what fits and what does not in an external publisher's frames.

use schemars::JsonSchema;
use serde::Serialize;
use vigil_setup::GraphArgs;

use crate::findings::{self, Finding, Status};
use vigil_terminal::output;
use vigil_terminal::{CommandError, Outcome};

use crate::publisher;

/// Listens to a publisher of sensor frames and says what to change in it.
///
/// It listens beside a running graph, or in its place while none runs. The exit code is 0 if
/// nothing that was judged is wrong.
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(flatten)]
    graph: GraphArgs,
    /// Time to listen, s.
    #[arg(
        long,
        value_name = "S",
        default_value_t = 5.0,
        visible_alias = "seconds"
    )]
    duration: f64,
    /// Print one JSON document.
    #[arg(long)]
    json: bool,
}

/// What it prints with --json.
#[derive(Debug, Serialize, JsonSchema)]
pub struct Document<'a> {
    /// Version of this document.
    schema_version: u32,
    /// False if something does not fit.
    ok: bool,
    /// Frames that came.
    frames: usize,
    /// Time for which it listened, s.
    seconds: f64,
    /// What was looked at.
    findings: &'a [Finding],
}

/// The last line: nothing fits as a whole that has not been judged as a whole.
fn end(found: &[Finding]) -> String {
    let all = [Status::Failure, Status::Warning, Status::Unjudged];
    let [wrong, warnings, unjudged] = all.map(|status| findings::count(found, status));
    if wrong + warnings + unjudged == 0 {
        return "the publisher fits".to_owned();
    }
    let mut end = match wrong {
        0 => "nothing is wrong in what was judged".to_owned(),
        _ => format!("to change: {wrong}, see FAILURE"),
    };
    for (what, count) in [("warnings", warnings), ("unjudged", unjudged)] {
        if count > 0 {
            end.push_str(&format!("; {what}: {count}"));
        }
    }
    end
}

/// Listens and tells; outcome `Failed` if something will not work.
///
/// # Errors
/// A configuration that is refused; a transport that cannot be opened for another reason than a
/// publisher's types.
pub fn run(args: &Args) -> Result<Outcome, CommandError> {
    if !(0.1..=3600.0).contains(&args.duration) {
        let message = format!("--duration {}: allowed is 0.1 to 3600", args.duration);
        return Err(CommandError::usage(message));
    }
    let mut border = args.graph.border().map_err(CommandError::usage)?;
    border.file.sensor.source = publisher::source(&border).map_err(CommandError::failure)?;
    if !args.json {
        eprintln!("listening for {} s", args.duration);
    }
    let (heard, unheard) = publisher::listen(&border, args.duration, &mut |heard, arrival, _| {
        heard.keep(arrival);
    })
    .map_err(CommandError::failure)?;
    let mut found = publisher::findings(&border, &heard);
    if let Some(error) = unheard {
        found.push(Finding::new(
            "listening",
            Status::Failure,
            error.to_string(),
        ));
    }
    // What is to be changed comes last, where it is read first.
    found.sort_by_key(|finding| finding.status);
    let ok = findings::have_no_failure(&found);
    if args.json {
        let document = Document {
            schema_version: 1,
            ok,
            frames: heard.frames.len(),
            seconds: heard.seconds,
            findings: &found,
        };
        output::json(&document).map_err(CommandError::failure)?;
    } else {
        findings::print(&found)?;
        output::line(&end(&found)).map_err(CommandError::failure)?;
    }
    Ok(if ok { Outcome::Done } else { Outcome::Failed })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_fits_that_was_not_judged() {
        let of = |all: &[Status]| {
            let found: Vec<Finding> = all.iter().map(|s| Finding::new("", *s, "")).collect();
            end(&found)
        };
        assert_eq!(of(&[Status::Ok, Status::Ok]), "the publisher fits");
        let unjudged = of(&[Status::Ok, Status::Unjudged]);
        assert_eq!(unjudged, "nothing is wrong in what was judged; unjudged: 1");
        let doubtful = of(&[Status::Warning, Status::Ok]);
        assert_eq!(doubtful, "nothing is wrong in what was judged; warnings: 1");
        let wrong = of(&[Status::Failure, Status::Unjudged]);
        assert_eq!(wrong, "to change: 1, see FAILURE; unjudged: 1");
    }
}
