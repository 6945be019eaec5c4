"""The command line. Light to import: worker processes import the main module again."""


def main() -> None:
    """Entry point of `inverse-service`; ends the process with the exit code of the contract."""
    from inverse_service.cli.command_line import run

    run()
