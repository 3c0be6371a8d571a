//! Which request may be answered.
//!
//! The server listens on 127.0.0.1, but every page that the user's browser has open can send requests there. So: the
//! request must name this address as its host (a name that somebody else's DNS points here is none), must come from a page
//! of this address where it says where it comes from, and must carry the token that stood in the opened address. The token
//! stands behind the `#`, which browsers never send, and goes in a header, which no foreign page can set; not in a
//! cookie, which every other server on this machine would be shown.

use axum::http::{HeaderMap, Method, StatusCode, header};

/// The header with the token.
pub const TOKEN: &str = "x-axiscal-token";

/// What a request must show.
#[derive(Debug, Clone)]
pub struct Guard {
    /// `127.0.0.1:PORT` and `localhost:PORT`.
    hosts: [String; 2],
    token: String,
}

/// Why a request is not answered.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Denied {
    /// The answer's status.
    pub status: StatusCode,
    /// In a word.
    pub code: &'static str,
    /// In a sentence.
    pub says: &'static str,
}

impl Guard {
    #[must_use]
    pub fn new(port: u16, token: String) -> Self {
        Self { hosts: [format!("127.0.0.1:{port}"), format!("localhost:{port}")], token }
    }

    /// The address to open.
    #[must_use]
    pub fn address(&self) -> String {
        format!("http://{}/#token={}", self.hosts[0], self.token)
    }

    /// Is it sent to this server, and by no foreign page?
    ///
    /// # Errors
    /// Why not.
    pub fn check_origin(&self, method: &Method, headers: &HeaderMap) -> Result<(), Denied> {
        let denied = |code, says| Err(Denied { status: StatusCode::FORBIDDEN, code, says });
        let one = |name: header::HeaderName| {
            let mut all = headers.get_all(name).iter();
            (all.next().map(|v| v.to_str().unwrap_or("?")), all.next().is_some())
        };
        match one(header::HOST) {
            (Some(host), false) if self.hosts.iter().any(|h| h == host) => {}
            _ => return denied("host", "this server answers to 127.0.0.1 only"),
        }
        let ours = |origin: &str| self.hosts.iter().any(|h| origin.strip_prefix("http://") == Some(h));
        match one(header::ORIGIN) {
            (Some(origin), false) if ours(origin) => {}
            (None, _) if matches!(*method, Method::GET | Method::HEAD) => {}
            _ => return denied("origin", "the request does not come from the workbench's own page"),
        }
        let site = headers.get("sec-fetch-site").map(|v| v.to_str().unwrap_or("?"));
        // the page itself may be opened from anywhere (there is nothing in it); what it asks for is of the same origin
        match site {
            None | Some("same-origin" | "none") => Ok(()),
            Some(_) if headers.get("sec-fetch-mode").is_some_and(|m| m == "navigate") && *method == Method::GET => {
                Ok(())
            }
            Some(_) => denied("site", "the request does not come from the workbench's own page"),
        }
    }

    /// Does it carry the token?
    ///
    /// # Errors
    /// When it does not.
    pub fn check_token(&self, headers: &HeaderMap) -> Result<(), Denied> {
        let given = headers.get(TOKEN).map_or(&b""[..], |v| v.as_bytes());
        let expected = self.token.as_bytes();
        // every byte is looked at, however early one differs
        let differs = given.iter().zip(expected).fold(given.len() ^ expected.len(), |d, (a, b)| d | usize::from(a ^ b));
        if differs == 0 && !expected.is_empty() {
            return Ok(());
        }
        Err(Denied {
            status: StatusCode::UNAUTHORIZED,
            code: "token",
            says: "open the address that the terminal shows: it ends in the token of this session",
        })
    }
}

/// A token that nobody can guess: 32 random bytes, hexadecimal.
///
/// # Errors
/// When the operating system has no random numbers.
pub fn token() -> crate::diag::Result<String> {
    let mut bytes = [0_u8; 32];
    getrandom::fill(&mut bytes).map_err(|e| {
        crate::diag::Failure::new("workbench::random", format!("the system gives no random numbers: {e}"))
            .help("without them the page could not be kept from others")
    })?;
    Ok(bytes.iter().map(|b| format!("{b:02x}")).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn headers(pairs: &[(&'static str, &str)]) -> HeaderMap {
        let mut out = HeaderMap::new();
        for (name, value) in pairs {
            out.append(*name, value.parse().unwrap());
        }
        out
    }

    #[test]
    fn only_this_address_and_its_own_page_are_answered() {
        let guard = Guard::new(8080, token().unwrap());
        let ok = |m: Method, pairs: &[(&'static str, &str)]| guard.check_origin(&m, &headers(pairs)).is_ok();
        let host = ("host", "127.0.0.1:8080");
        assert!(ok(Method::GET, &[host]));
        assert!(ok(Method::GET, &[("host", "localhost:8080"), ("sec-fetch-site", "none")]));
        assert!(ok(Method::POST, &[host, ("origin", "http://127.0.0.1:8080"), ("sec-fetch-site", "same-origin")]));
        for bad in ["evil.example:8080", "127.0.0.1", "127.0.0.1:8081", "127.0.0.1:8080.evil.example", "", "[::1]:8080"]
        {
            assert!(!ok(Method::GET, &[("host", bad)]), "{bad}");
        }
        assert!(!ok(Method::GET, &[]));
        assert!(!ok(Method::GET, &[host, ("host", "evil.example")]));
        assert!(!ok(Method::POST, &[host]));
        for bad in ["http://evil.example", "null", "https://127.0.0.1:8080", "http://127.0.0.1:8081", "127.0.0.1:8080"]
        {
            assert!(!ok(Method::POST, &[host, ("origin", bad)]), "{bad}");
            assert!(!ok(Method::GET, &[host, ("origin", bad)]), "{bad}");
        }
        assert!(!ok(Method::GET, &[host, ("sec-fetch-site", "cross-site"), ("sec-fetch-mode", "no-cors")]));
        assert!(ok(Method::GET, &[host, ("sec-fetch-site", "cross-site"), ("sec-fetch-mode", "navigate")]));
    }

    #[test]
    fn the_token_must_be_whole() {
        let token = token().unwrap();
        let guard = Guard::new(1, token.clone());
        assert_eq!(token.len(), 64);
        assert!(guard.check_token(&headers(&[(TOKEN, &token)])).is_ok());
        for bad in ["", &token[1..], &token[..63], &format!("{token}0"), &"0".repeat(64)] {
            assert!(guard.check_token(&headers(&[(TOKEN, bad)])).is_err(), "{bad}");
        }
        assert!(guard.check_token(&HeaderMap::new()).is_err());
        assert!(Guard::new(1, String::new()).check_token(&HeaderMap::new()).is_err());
        assert_ne!(token, super::token().unwrap());
    }
}
