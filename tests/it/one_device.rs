//! A station with one device over TCP, whose user is a Supervisor.

use std::{fs, path::PathBuf, process::Command};

use tempfile::TempDir;

use crate::support::{Process, folder, sightglass, sockets};

pub struct OneDevice {
    pub plant: PathBuf,
    folder: TempDir,
    runtime: PathBuf,
    station: Process,
}

impl OneDevice {
    /// Starts it with the profile `map`, and waits until the device, unit 1, responds.
    pub fn start(device: &str, map: &str, port: u16) -> OneDevice {
        let (folder, runtime) = (folder(), sockets());
        fs::create_dir(folder.path().join("devices")).unwrap();
        fs::write(folder.path().join("devices/one.toml"), map).unwrap();
        let user = String::from_utf8(Command::new("id").arg("-un").output().unwrap().stdout).unwrap();
        let text = format!(
            "title = \"One\"\ntime_zone = \"Asia/Bangkok\"\n\
             [[line]]\nname = \"L1\"\nmode = \"tcp\"\nhost = \"127.0.0.1\"\ntcp_port = {port}\n\
             [[device]]\nname = \"{device}\"\nprofile = \"one\"\nline = \"L1\"\nunit = 1\nfast = \"1s\"\n\
             [[access.trusted]]\nuser = \"{}\"\nrole = \"supervisor\"\n",
            user.trim()
        );
        let (plant, history) = (folder.path().join("one_plant.toml"), folder.path().join("h.duckdb"));
        fs::write(&plant, text).unwrap();
        let mut run = sightglass();
        run.env("XDG_RUNTIME_DIR", &runtime).env("XDG_STATE_HOME", folder.path());
        run.arg("run").arg(&plant).arg("--history").arg(history);
        let mut station = Process::start(&mut run);
        station.wait_for(&format!("device {device} (unit 1): responding"));
        OneDevice { plant, folder, runtime, station }
    }

    /// What a command at it ends with, and prints.
    pub fn said(&self, args: &[&str]) -> (Option<i32>, String) {
        let mut command = sightglass();
        command.env("XDG_RUNTIME_DIR", &self.runtime).env("XDG_STATE_HOME", self.folder.path()).args(args);
        let output = command.output().unwrap();
        (output.status.code(), String::from_utf8([output.stdout, output.stderr].concat()).unwrap())
    }

    /// Ends the station as a service manager does.
    pub fn stop(&mut self) {
        self.station.signal("TERM");
        assert_eq!(self.station.end(), Some(0));
    }
}
