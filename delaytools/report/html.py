"""A page as one self-contained HTML file: no request leaves it."""

from jinja2 import Environment, PackageLoader, select_autoescape
from markupsafe import Markup

from delaytools.report.page import Page

__all__ = ["ENVIRONMENT", "html_page"]

ENVIRONMENT = Environment(
    loader=PackageLoader("delaytools.report", "templates"),
    autoescape=select_autoescape(default=True, default_for_string=True),
    trim_blocks=True,
    lstrip_blocks=True,
)


def html_page(page: Page) -> str:
    """The HTML text; figures stand in it as inline SVG."""
    drawings = {figure.name: Markup(figure.svg) for section in page.sections for figure in section.figures}
    return ENVIRONMENT.get_template("report.html").render(page=page, drawings=drawings)
