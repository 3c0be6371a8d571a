//! A workbench as its page speaks with it.

use super::{Program, asked};
use serde_json::Value;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::path::Path;
use std::process::{Child, Stdio};
use std::time::Duration;

pub struct Page {
    child: Child,
    port: u16,
    token: String,
}

impl Drop for Page {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

impl Page {
    pub fn open(program: &Program, at: &Path) -> Self {
        let mut command = program.command(at, &["--json", "workbench", "study.toml", "--no-open"]);
        let mut child = command.env("XDG_DATA_HOME", at.join("data")).stdout(Stdio::piped()).spawn().unwrap();
        let mut out = BufReader::new(child.stdout.take().unwrap());
        let mut said = String::new();
        while !said.ends_with("}\n") {
            assert!(out.read_line(&mut said).unwrap() > 0, "the workbench ended: {said}");
        }
        let said: Value = serde_json::from_str(&said).unwrap();
        let address = said["address"].as_str().unwrap().strip_prefix("http://127.0.0.1:").unwrap();
        let (port, token) = address.split_once("/#token=").unwrap();
        Self { child, port: port.parse().unwrap(), token: token.to_owned() }
    }

    /// Clicks on an effect, as of the state that the page shows. Was it done?
    pub fn switch(&self, effect: &str, on: bool) -> bool {
        let (_, state) = self.send("GET", "/api/state", "");
        let (status, answer) = self.send("POST", "/api/step", &asked(state["version"].as_u64().unwrap(), effect, on));
        assert_eq!(status, 200, "{answer}");
        // refused as changed meanwhile, or because another one works on it
        answer["error"].is_null()
    }

    fn send(&self, method: &str, path: &str, body: &str) -> (u16, Value) {
        let mut stream = TcpStream::connect(("127.0.0.1", self.port)).unwrap();
        stream.set_read_timeout(Some(Duration::from_secs(120))).unwrap();
        let host = format!("127.0.0.1:{}", self.port);
        let request = format!(
            "{method} {path} HTTP/1.1\r\nConnection: close\r\nHost: {host}\r\nOrigin: http://{host}\r\nX-Axiscal-Token: {}\r\n\
             Content-Type: application/json\r\nContent-Length: {}\r\n\r\n{body}",
            self.token,
            body.len()
        );
        stream.write_all(request.as_bytes()).unwrap();
        let mut text = String::new();
        stream.read_to_string(&mut text).unwrap();
        let (head, body) = text.split_once("\r\n\r\n").unwrap();
        let status = head.split(' ').nth(1).unwrap().parse().unwrap();
        // the text of a long answer comes in pieces, each with its length: not of interest here but for the state
        (status, serde_json::from_str(body).unwrap_or(Value::Null))
    }
}
