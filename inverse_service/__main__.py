"""`python -m inverse_service` is `inverse-service`."""

from inverse_service.cli import main

if __name__ == "__main__":
    main()
