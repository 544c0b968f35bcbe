"""Generates and compiles Python messages of ROS 2 packages for rclpy: what colcon and CMake do, by the same
generators.

Run by the Python of an environment with rclpy and the generators, `rclpy_messages.py DIRECTORY PACKAGE...`,
where DIRECTORY/PACKAGE has msg/*.msg and srv/*.srv.
"""

import json
import shutil
import subprocess
import sys
import sysconfig
from pathlib import Path

import numpy
from rosidl_adapter.msg import convert_msg_to_idl
from rosidl_adapter.srv import convert_srv_to_idl
from rosidl_cli.command.helpers import generate_visibility_control_file
from rosidl_generator_c import generate_c
from rosidl_generator_py import generate_py
from rosidl_generator_type_description import generate_type_hash
from rosidl_typesupport_c import generate_c as generate_dispatch
from rosidl_typesupport_fastrtps_c import generate_typesupport_fastrtps_c
from rosidl_typesupport_introspection_c import generate_c as generate_introspection

PREFIX = Path(sys.prefix)
WIRE, INTROSPECTION = "rosidl_typesupport_fastrtps_c", "rosidl_typesupport_introspection_c"
GENERATORS = ("rosidl_generator_c", "rosidl_generator_py", "rosidl_typesupport_c", WIRE, INTROSPECTION)


def build(package, source):
    out = source / "generated"
    shutil.rmtree(out, ignore_errors=True)
    for file in sorted(source.glob("*/*.*")):
        convert = convert_srv_to_idl if file.suffix == ".srv" else convert_msg_to_idl
        convert(source, package, file.relative_to(source), out / "idl" / package / file.parent.name)
    generate(package, out)
    messages = out / "rosidl_generator_py" / package
    module = messages / f"{package}_s__rosidl_typesupport_c.so"
    compile_(module, out)
    shutil.copytree(
        messages,
        Path(sysconfig.get_path("purelib")) / package,
        ignore=shutil.ignore_patterns("*.c"),
        dirs_exist_ok=True,
    )
    for name in (WIRE, INTROSPECTION):  # as which the middleware looks for it
        shutil.copy(module, PREFIX / "lib" / f"lib{package}__{name}.so")


def generate(package, out):
    """Call each generator as CMake does, with a file of arguments and a folder of its own."""
    share, idl = PREFIX / "share", out / "idl" / package
    interfaces, dependencies = sorted(idl.glob("*/*.idl")), sorted(share.glob("*/*/*.idl"))
    arguments = {
        "package_name": package,
        "idl_tuples": [f"{idl}:{file.relative_to(idl)}" for file in interfaces],
        "ros_interface_files": [str(file) for file in interfaces],
        "ros_interface_dependencies": [f"{file.parents[1].name}:{file}" for file in dependencies],
        "include_paths": [
            f"{name}:{share / name}" for name in sorted({file.parents[1].name for file in dependencies})
        ],
        "target_dependencies": [],
    }

    def call(generator, name, *rest):
        templates, folder, header = (
            share / name / "resource",
            out / name / package,
            f"{name}__visibility_control.h",
        )
        folder.mkdir(parents=True)
        if (templates / f"{header}.in").exists():
            generate_visibility_control_file(
                package_name=package,
                template_path=templates / f"{header}.in",
                output_path=folder / "msg" / header,
            )
        file = out / f"{name}.json"
        file.write_text(json.dumps(arguments | {"template_dir": str(templates), "output_dir": str(folder)}))
        return generator(str(file), *rest)

    described = {
        Path(file).stem: file for file in call(generate_type_hash, "rosidl_generator_type_description")
    }
    arguments["type_description_tuples"] = [
        f"{file.relative_to(idl)}:{described[file.stem]}" for file in interfaces
    ]
    call(generate_c, "rosidl_generator_c")
    call(generate_typesupport_fastrtps_c, WIRE)
    call(generate_introspection, INTROSPECTION)
    call(generate_dispatch, "rosidl_typesupport_c", [WIRE, INTROSPECTION])
    call(generate_py, "rosidl_generator_py", ["rosidl_typesupport_c"])


def compile_(module, out):
    """Compile all into the one module that Python imports."""
    folders = [
        *(out / name for name in GENERATORS),
        sysconfig.get_path("include"),
        numpy.get_include(),
        PREFIX / "include",
        *(PREFIX / "include").iterdir(),
    ]
    sources = sorted(file for suffix in ("c", "cpp") for file in out.rglob(f"*.{suffix}"))
    libraries = [
        file
        for file in sorted((PREFIX / "lib").glob("lib*.so"))
        if file.stem.endswith(("_c", "_cpp", "_py", "rcutils", "fastcdr"))
    ]
    subprocess.run(
        [
            "gcc",
            "-fPIC",
            "-shared",
            "-o",
            module,
            *(f"-I{folder}" for folder in folders),
            *sources,
            *libraries,
            "-lstdc++",
        ],
        check=True,
    )


if __name__ == "__main__":
    for name in sys.argv[2:]:
        build(name, Path(sys.argv[1]) / name)
