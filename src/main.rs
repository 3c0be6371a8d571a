//! The `axiscal` binary: arguments → command → exit code.

fn main() -> std::process::ExitCode {
    axiscal::cli::main()
}
