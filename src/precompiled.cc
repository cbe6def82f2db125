// The headers that CMakeLists.txt names, compiled for all modules.
