#!/usr/bin/env bash
# ros_wheels.sh VENV: turns a virtual environment with the ROS 2 Jazzy wheels into an underlay that colcon can build on.
# Idempotent. The wheels are built elsewhere and keep traces of it:
set -euo pipefail
venv=$1

# 1. Message packages export an include path of the build host that does not exist here; CMake refuses such a target.
grep -rlE 'INTERFACE_INCLUDE_DIRECTORIES "/opt/python/' "$venv/share" --include='*Export.cmake' 2>/dev/null \
    | xargs -r sed -i -E 's#(INTERFACE_INCLUDE_DIRECTORIES) "/opt/python/[^"]*"#\1 ""#'

# 2. Fast DDS names the build host's tinyxml2 by absolute path; it is linked into the wheel's library already.
sed -i -E 's#/usr/lib64/libtinyxml2\.so;?##g' "$venv/share/fastrtps/cmake/fastrtps-shared-targets.cmake"

# 3. C++ programs cannot link messages against the wheels (there is no rclcpp): message packages get no type support for C++.
# The files may be links into uv's cache: replaced, never written.
for generator in rosidl_generator_cpp rosidl_typesupport_cpp rosidl_typesupport_fastrtps_cpp rosidl_typesupport_introspection_cpp; do
    generate="$venv/share/$generator/cmake/${generator}_generate_interfaces.cmake"
    rm -f "$generate"
    echo "# emptied by scripts/ros_wheels.sh" > "$generate"
done

# 4. The wheels carry no prefix-level set-up files; with them, install/setup.bash of any workspace chains this underlay.
for sh in sh bash zsh; do
    cat > "$venv/local_setup.$sh" <<EOF
_p="$venv"
case ":\${AMENT_PREFIX_PATH:-}:" in *":\$_p:"*) ;; *) export AMENT_PREFIX_PATH="\$_p\${AMENT_PREFIX_PATH:+:\$AMENT_PREFIX_PATH}";; esac
case ":\$PATH:" in *":\$_p/bin:"*) ;; *) export PATH="\$_p/bin:\$PATH";; esac
unset _p
EOF
    cp "$venv/local_setup.$sh" "$venv/setup.$sh"
done
