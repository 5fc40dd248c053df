"""From a study file to a report: the whole pipeline, and the only package that writes one."""
