/* A source of random numbers that pydantic imports and wine 8 lacks. */
int __stdcall SystemFunction036(void *, unsigned long); /* RtlGenRandom */

__declspec(dllexport) int __stdcall ProcessPrng(unsigned char *out, unsigned long long n)
{
    return SystemFunction036(out, (unsigned long)n);
}
