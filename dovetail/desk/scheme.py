"""Light or dark: the server makes the figures, so that the address says which colours the browser prefers."""

from nicegui import Client

KEY, LIGHT, DARK = "scheme", "light", "dark"
_SCRIPT = """<script>(() => {{
  const dark = matchMedia("(prefers-color-scheme: dark)");
  const load = () => {{
    const address = new URL(location.href);
    address.searchParams.set("{key}", dark.matches ? "{dark}" : "{light}");
    location.replace(address);
  }};
  {when}
}})();</script>"""
ASK = _SCRIPT.format(key=KEY, dark=DARK, light=LIGHT, when="load();")
"""A page that loads the desk in the preferred colours."""
FOLLOW = _SCRIPT.format(key=KEY, dark=DARK, light=LIGHT, when='dark.addEventListener("change", load);')
"""Loads the desk again when the preference changes; its state is the server's."""


def is_dark(client: Client) -> bool:
    """Return whether a tab shows the desk in light colours on a dark page."""
    return client.request.query_params.get(KEY) == DARK
