/* The extension that holds all compiled modules; lcf_edge/compilation.py takes them out of it.
   This module itself says which those are, MODULES, and of which files it was made, SOURCES, "path:crc32" of each;
   both come from setup.py. */
#include <Python.h>

static struct PyModuleDef definition = {
    PyModuleDef_HEAD_INIT, .m_name = "_compiled", .m_doc = "What is compiled, and of which files.", .m_size = 0};

PyMODINIT_FUNC PyInit__compiled(void)
{
    PyObject *module = PyModule_Create(&definition);
    if (module != NULL && (PyModule_AddStringConstant(module, "MODULES", MODULES) < 0 ||
                           PyModule_AddStringConstant(module, "SOURCES", SOURCES) < 0)) {
        Py_DECREF(module);
        return NULL;
    }
    return module;
}
