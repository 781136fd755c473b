//! `sightglass systemd-unit`: the systemd unit that runs stations on a panel PC.

use super::{CliError, say};

/// The unit, with a place for the path of this program.
const UNIT: &str = include_str!("sightglass@.service");

/// Prints the unit for this very program.
pub fn main() -> Result<(), CliError> {
    let exe = std::env::current_exe().map_err(CliError::io("cannot find the path of this program"))?;
    say(unit(&exe.to_string_lossy()).trim_end());
    Ok(())
}

fn unit(exe: &str) -> String {
    // A space or a per cent sign in a path would be read as something else.
    let exe = exe.replace('%', "%%");
    let exe = if exe.contains(' ') { format!("\"{exe}\"") } else { exe };
    UNIT.replace("@EXE@", &exe)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_unit_names_this_program() {
        let text = unit("/opt/sight glass/100%");
        assert!(text.contains("ExecStart=\"/opt/sight glass/100%%\" run /etc/sightglass/%i.toml"), "{text}");
        assert!(!text.contains("@EXE@"));
    }

    #[test]
    fn the_unit_bounds_what_a_station_can_take_and_reach() {
        for line in ["LimitCORE=0", "MemoryMax=1G", "OOMScoreAdjust=-500", "IPAddressDeny=any", "UMask=0027"] {
            assert!(UNIT.lines().any(|there| there == line), "{line}");
        }
        assert!(UNIT.lines().any(|line| line.starts_with("IPAddressAllow=localhost ")));
    }
}
